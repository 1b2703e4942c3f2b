"""Who exactly it is, asked by the very driver that will drive it, over the line it will drive it by.

How the gateway will go about things on that mount are the driver's rows, narrowed to what this version has.
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
from gateway.mount.link.driver_runner import carry_out
from gateway.mount.link.line import MountLink
from gateway.protocols.base.driver import Driver, Send
from gateway.protocols.registry import PROTOCOLS

#: Seconds in all; a mount that answers takes less than two.
LONGEST = 20.0
#: How long a question that may stay unanswered is waited for: so many times the longest answer so far, but at least…
#: A telescope that has answered in 30 ms will not take the second and a half that a stranger is given.
TIMES, AT_LEAST = 4.0, 0.6
POSITIONS = 2

_T = TypeVar("_T")


class Mount(Struct, frozen=True):
    """A mount that was found. ``latency`` is the median of its answers in seconds; ``equinox`` is ``jnow`` or ``j2000``
    by its version, ``aligned`` None when it could not say; ``ways`` are how the gateway will go about things."""

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
    """Carries a driver's questions to a line, and keeps the time."""

    def __init__(self, driver: Driver, line: MountLink) -> None:
        self.driver, self.line = driver, line
        self.took: list[float] = []

    async def perform(self, operation: op.Operation[_T]) -> _T:
        """The operation's answer. Raises Fault."""
        return await carry_out(self.driver.perform(operation), self._exchange, lambda later: None)

    async def _exchange(self, ask: Send) -> Values:
        if ask.patience is not None and self.took:
            ask = ask._replace(patience=min(ask.patience, max(AT_LEAST, TIMES * max(self.took))))
        answer = await self.line.exchange(ask)
        if self.driver.protocol.commands[ask.command].replies:
            self.took.append(self.line.talk.times.took)
        return answer


async def identify(protocol: str, ear: PortListener, model: str | None = None, version: str | None = None) -> Mount:
    """Let the protocol's driver find out what is on an open wire. Raises Fault when it does not get that far."""
    now = asyncio.get_running_loop().time
    driver, _, dialogue = make_driver(Endpoint(protocol, ear.name, model, version), MountConfig(at="-"), now)
    line = MountLink(ear, dialogue, WireLog(time.time))
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
    """An answer that the mount need not be able to give."""
    try:
        return await talk.perform(operation)
    except Fault:
        return None


class Row(NamedTuple):
    """``none``: the words for a mount that has none of the commands that its protocol has for it."""

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
    """What is done -> by which commands, or by what in their place. The driver must have identified its mount."""
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
