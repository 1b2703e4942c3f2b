"""What the web server says on the terminal: its own failures, with their traceback.

A request that is no HTTP is answered with 400. That is nobody's failure here, and nothing is said about it.
"""

from __future__ import annotations

import logging
from functools import cache


@cache
def web_log() -> logging.Logger:
    """The log for a web server's ``logger``."""
    log = logging.getLogger("gateway.web")
    log.addFilter(_is_ours)
    return log


def _is_ours(record: logging.LogRecord) -> bool:
    """Whether it is more than a request that cannot be read."""
    from aiohttp.http_exceptions import HttpProcessingError

    return not (record.exc_info and isinstance(record.exc_info[1], HttpProcessingError))
