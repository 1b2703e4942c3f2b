"""What must be known before the mount is set moving, should this process be killed: a mark on disk, a watchdog."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

Announce = Callable[[], Awaitable[None]]


async def _nobody() -> None:
    """Nobody needs to know."""


class BeforeMotion:
    """``announce`` is awaited before the mount is sent anything that sets it moving; the application may set it."""

    def __init__(self) -> None:
        self.announce: Announce = _nobody
