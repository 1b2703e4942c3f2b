"""Identify a mount with the driver and the mount link that the gateway would use for it.

How the gateway would carry out each operation on that mount follows from the driver's rows and the commands that this
version has.
"""

from __future__ import annotations

import asyncio
import statistics
import time
from typing import NamedTuple, TypeVar

from msgspec import Struct

from gateway.app.bindings import make_driver
from gateway.app.config import Endpoint, MountConfig
from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer
from gateway.core.operations import Values
from gateway.core.wire_log import WireLog
from gateway.diagnostics.detect.port_listener import PortListener
from gateway.mount.link.driver_runner import run_driver
from gateway.mount.link.line import MountLink
from gateway.protocols.base.driver import Driver, Send
from gateway.protocols.registry import PROTOCOLS

#: Timeout of the whole identification, seconds; a mount that answers needs less than two.
LONGEST = 20.0
#: The timeout of a query that some mounts do not answer: so many times the longest reply time so far, but at least so
#: many seconds. A telescope that answers in 30 ms does not need the 1.5 s that an unknown device gets.
TIMES, AT_LEAST = 4.0, 0.6
POSITIONS = 2

_T = TypeVar("_T")


class Mount(Struct, frozen=True):
    """A mount that was found. ``latency`` is its median reply time in seconds; ``equinox`` is ``jnow`` or ``j2000``
    according to its version; ``aligned`` is None if it did not say; ``ways`` tell how the gateway would carry out
    operations."""

    protocol: str
    product: str
    model: str
    version: str
    motors: tuple[str, ...]
    latency: float
    equinox: str
    aligned: bool | None
    equatorial: bool | None
    tells_model: bool
    tells_place: bool
    ways: dict[str, str]


class _Talk:
    """Carries out a driver's exchanges on a mount link and records the reply times."""

    def __init__(self, driver: Driver, line: MountLink) -> None:
        self.driver, self.line = driver, line
        self.took: list[float] = []

    async def perform(self, operation: op.Operation[_T]) -> _T:
        """Return the operation's answer. Raises Fault."""
        return await run_driver(self.driver.perform(operation), self._exchange, lambda later: None)

    async def _exchange(self, ask: Send) -> Values:
        if ask.patience is not None and self.took:
            ask = ask._replace(patience=min(ask.patience, max(AT_LEAST, TIMES * max(self.took))))
        answer = await self.line.exchange(ask)
        if self.driver.protocol.commands[ask.command].replies:
            self.took.append(self.line.transaction.times.last_rtt)
        return answer


async def identify(protocol: str, ear: PortListener, model: str | None = None, version: str | None = None) -> Mount:
    """Let the protocol's driver identify the mount on an open port. Raises Fault if it cannot."""
    now = asyncio.get_running_loop().time
    driver, _, reply_rules = make_driver(Endpoint(protocol, ear.name, model, version), MountConfig(at="-"), now)
    line = MountLink(ear, reply_rules, WireLog(time.time))
    talk = _Talk(driver, line)
    line.start()
    try:
        async with asyncio.timeout(LONGEST):
            identity: op.Identity = await talk.perform(op.GetIdentity())
            status: op.Status | None = await _maybe(talk, op.GetStatus())
            for _ in range(POSITIONS):
                await _maybe(talk, op.Position())
    except TimeoutError:
        raise NoAnswer from None
    finally:
        await line.close()
    return Mount(
        protocol=protocol,
        product=identity.product,
        model=identity.model,
        version=identity.version,
        motors=identity.motors,
        latency=statistics.median(talk.took),
        equinox=driver.equinox,
        aligned=status.aligned if status else None,
        equatorial=status.equatorial if status else None,
        tells_model=identity.model in driver.protocol.models,
        tells_place=driver.gps
        or any(driver.supports(name) for name in ("w", "Gt") if name in driver.protocol.commands),
        ways=ways(driver),
    )


async def _maybe(talk: _Talk, operation: op.Operation[_T]) -> _T | None:
    """Return the answer, or None if the mount cannot give it."""
    try:
        return await talk.perform(operation)
    except Fault:
        return None


class Row(NamedTuple):
    """``none`` is shown for a mount that has none of the commands that its protocol offers for the operation."""

    name: str
    operation: type[op.Operation]
    none: str


ROWS = (
    Row("coordinates", op.Position, ""),
    Row("tracking", op.SetTracking, "left to the mount"),
    Row("sync", op.Sync, "the gateway's offset"),
    Row("arrows", op.Move, "small gotos"),
    Row("site", op.GetSite, "its GPS unit, or --site"),
    Row("clock", op.GetClock, "its GPS unit or this computer's"),
)


def ways(driver: Driver) -> dict[str, str]:
    """Return what each row's operation is done by: commands, or their substitute. The mount must be identified."""
    found = {}
    for row in ROWS:
        way = driver.implementation(row.operation)
        if way is not None:
            first = PROTOCOLS[driver.protocol.name].capabilities.get(row.name, {})
            known = [name for name in first if name in way.commands and driver.supports(name)]
            found[row.name] = first[known[0]] if known else row.none
    if not getattr(driver, "tells_status", True):
        found["tracking"] = "left to the mount"  # a Meade without :GW# would lose its alignment over :AL#
    return found
