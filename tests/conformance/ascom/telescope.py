"""A telescope as ASCOM's judge sees it: members by their names in ASCOM's interface, answers as over HTTP.

A check raises ``Issue`` with what is wrong. A member that answers with an error raises ``Ascom``, which is an issue,
too, unless the check expects it. Members that answer later than ASCOM asks for are noted.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from gateway.astro.spherical import hour_angle_to_horizon, wrap180
from gateway.diagnostics.rehearsal.stage import RehearsalGateway
from gateway.protocols.alpaca.http.programs import AlpacaDevice
from gateway.protocols.alpaca.http.requests import BadRequest, parse_request
from gateway.protocols.alpaca.tables import empty_value
from gateway.transport.web_server import WebDevice

NOT_IMPLEMENTED, INVALID, NOT_SET, PARKED, NOT_NOW = 0x400, 0x401, 0x402, 0x408, 0x40B
#: Seconds until an answer: to a read (ASCOM wishes 0.1, which an exchange with a mount can take), to a write or the
#: begin of a motion, and to a method that is answered at its end.
FAST, STANDARD, EXTENDED = 0.5, 1.0, 600.0
#: How long a slew may take, and a stop; how often it is asked for.
LONGEST, STOPPING, EVERY = 300.0, 30.0, 0.2
AT_ITS_END = {"SlewToCoordinates", "SlewToTarget", "SlewToAltAz"}


class Issue(Exception):
    """What is wrong."""


class Skipped(Exception):
    """The check does not apply to this mount."""


class Ascom(Exception):
    """An error with its number."""

    def __init__(self, number: int, words: str) -> None:
        super().__init__(f"error {number:#x}: {words}")
        self.number = number


Check = Callable[["Telescope"], Awaitable[None]]


def must(holds: bool, words: str) -> None:
    if not holds:
        raise Issue(words)


def needs(scope: Telescope, ability: str) -> None:
    if not scope.can[ability]:
        raise Skipped


class Telescope:
    """One program, the gateway and the mount; ``late`` are the members that were answered too late."""

    def __init__(self, own: RehearsalGateway) -> None:
        self.own = own
        self.late: dict[str, float] = {}
        self.can: dict[str, bool] = {}
        self._device = AlpacaDevice(WebDevice(own.acceptor.accept, "a mount", own.controller.wire_log))

    async def _ask(self, method: str, member: str, parameters: dict[str, Any], target: float) -> Any:
        pairs = [(name, str(value)) for name, value in parameters.items()] + [("ClientID", "1")]
        began = asyncio.get_running_loop().time()
        try:
            asked = parse_request(method, member.lower(), pairs)
        except BadRequest as error:
            raise Issue(f"HTTP 400: {error}") from None
        reply = {**empty_value(asked.command), **await self._device.answer(asked, "192.168.1.7")}
        seconds = asyncio.get_running_loop().time() - began
        if seconds > target:
            self.late[f"{method} {member}"] = max(seconds, self.late.get(f"{method} {member}", 0.0))
        if reply["ErrorNumber"]:
            raise Ascom(reply["ErrorNumber"], reply["ErrorMessage"])
        return reply.get("Value")

    async def get(self, member: str, **parameters: Any) -> Any:
        return await self._ask("GET", member, parameters, FAST)

    async def put(self, member: str, **parameters: Any) -> None:
        await self._ask("PUT", member, parameters, EXTENDED if member in AT_ITS_END else STANDARD)

    async def write(self, member: str, value: Any) -> None:
        await self.put(member, **{member: value})

    async def refuses(self, member: str, *numbers: int, **parameters: Any) -> None:
        """A write or a method that must be refused with one of these numbers."""
        try:
            await self.put(member, **parameters)
        except Ascom as error:
            must(error.number in numbers, f"{member}{parameters}: {error}")
        else:
            raise Issue(f"{member}{parameters} is not refused")

    async def while_true(self, member: str, seconds: float) -> None:
        end = asyncio.get_running_loop().time() + seconds
        while await self.get(member):
            must(asyncio.get_running_loop().time() < end, f"{member} is true for more than {seconds:g} s")
            await asyncio.sleep(EVERY)

    async def stands(self, seconds: float = LONGEST) -> None:
        await self.while_true("Slewing", seconds)

    # --- where to ----------------------------------------------------------------------------------------------------

    async def tracks(self, on: bool = True) -> None:
        """Switch tracking, if the mount can."""
        if self.can["SetTracking"]:
            await self.write("Tracking", on)

    async def at_hour_angle(self, hours: float) -> float:
        return float((await self.get("SiderealTime") - hours) % 24.0)

    async def high(self, hours: float) -> float:
        """The declination at this hour angle that stands highest below 65 degrees."""
        return max(await self._heights(hours, 65.0))[1]

    async def halfway(self, hours: float) -> float:
        """The declination at this hour angle that is halfway between horizon and pole."""
        above = [dec for height, dec in await self._heights(hours, 90.0) if height > 0.0]
        north = await self.get("SiteLatitude") >= 0.0
        return (min(above) + 90.0) / 2.0 if north else (max(above) - 90.0) / 2.0

    async def _heights(self, hours: float, most: float) -> list[tuple[float, float]]:
        latitude = await self.get("SiteLatitude")
        found = [(hour_angle_to_horizon(hours * 15.0, dec, latitude)[1], float(dec)) for dec in range(-85, 90, 10)]
        return [one for one in found if one[0] < most]

    async def slew(self, ra: float, dec: float) -> None:
        await self.tracks()
        await self.put("SlewToCoordinatesAsync", RightAscension=ra, Declination=dec)
        await self.stands()

    async def slew_to_hour_angle(self, hours: float) -> None:
        await self.slew(await self.at_hour_angle(hours), await self.high(hours))

    async def points_at(self, ra: float, dec: float, words: str, arcseconds: float = 10.0) -> None:
        """The mount must report this place; hours and degrees."""
        east = abs(wrap180((await self.get("RightAscension") - ra) * 15.0)) * 3600.0
        north = abs(await self.get("Declination") - dec) * 3600.0
        must(max(east, north) <= arcseconds, f"{words}: {east:.1f} arcseconds off in RA, {north:.1f} in declination")
