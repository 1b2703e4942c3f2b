"""The log of the web server on the terminal: its own failures, with their traceback.

A request that is not valid HTTP is answered with 400 and not logged, because it is no failure of the server; nor is
a client that leaves before its request is whole.
"""

from __future__ import annotations

import logging
from functools import cache


@cache
def web_log() -> logging.Logger:
    """Return the log for a web server's ``logger``."""
    log = logging.getLogger("gateway.web")
    log.addFilter(_is_ours)
    return log


def _is_ours(record: logging.LogRecord) -> bool:
    """Whether a record is more than an invalid or incomplete request."""
    from aiohttp.http_exceptions import HttpProcessingError

    return not (record.exc_info and isinstance(record.exc_info[1], HttpProcessingError | ConnectionError))
