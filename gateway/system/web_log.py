"""Where web servers of the gateway write what goes wrong in them: to the terminal, as every log, but for one thing.

A request that is no HTTP is the fault of whoever sent it, and is answered with 400. Anybody could fill the terminal
with tracebacks by it.
"""

from __future__ import annotations

import logging

#: Where the errors of requests that cannot be read are defined.
UNREADABLE = "aiohttp.http_exceptions"


def web_log() -> logging.Logger:
    """For ``AppRunner(logger=...)``."""
    log = logging.getLogger("gateway.web")
    log.addFilter(_of_our_own)  # the same one is not added twice
    return log


def _of_our_own(record: logging.LogRecord) -> bool:
    kind = record.exc_info[0] if record.exc_info else None
    return kind is None or kind.__module__ != UNREADABLE
