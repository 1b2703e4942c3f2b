"""The last readings instead of new ones, for a rule that is applied in advance: the mount is not asked.

What somebody is told in advance must not change what the mount is sent, nor when: nothing is noted here, not even that
somebody looks. A reading that there is not yet raises ``NotRead``.
"""

from __future__ import annotations

from typing import Protocol, TypeVar, cast

from gateway.core import operations as op
from gateway.mount.context import Context

_T = TypeVar("_T")


class NotRead(Exception):
    """The mount has not been asked for this yet."""


class Readings(Protocol):
    """What the rules ask for readings of the mount: the ``Reader``, or ``LastReadings``."""

    async def read(self, operation: op.Operation[_T]) -> _T: ...
    async def read_now(self, operation: op.Operation[_T]) -> _T: ...
    async def tube_side(self) -> str | None: ...


class LastReadings:
    """The last readings, however old."""

    def __init__(self, context: Context) -> None:
        self._cache, self._driver = context.cache, context.driver

    async def read(self, operation: op.Operation[_T]) -> _T:
        """Return the last reading. Raises NotRead."""
        value = self._cache.value(type(operation))
        if value is None:
            raise NotRead
        return cast(_T, value)

    read_now = read

    async def tube_side(self) -> str | None:
        """Return the pier side (E, W) of the tube of a German mount; None for other mounts. Raises NotRead."""
        return None if self._driver.tube_side("E") is None else self._driver.tube_side(await self.read(op.PierSide()))
