"""Programs of four protocols as a judge uses them, their bytes typed by hand. What has no words there is None."""

from __future__ import annotations

import asyncio
import calendar
import json
import struct
from datetime import UTC, datetime, timedelta
from typing import Any

from gateway.astro.axes import Build
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import wrap360
from tests.support.in_process_gateway import Bridge, RehearsalClient
from tests.support.two_gateways import equatorial

FACES = ("lx200", "nexstar", "stellarium", "alpaca")


class Refusal(Exception):
    """The gateway has refused an order, in words if the protocol has any."""


def hms(degrees: float) -> str:
    seconds = round(degrees * 240) % 86400
    return f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"


def dms(degrees: float) -> str:
    seconds = round(abs(degrees) * 3600)
    return f"{'-' if degrees < 0 else '+'}{seconds // 3600:02d}*{seconds // 60 % 60:02d}:{seconds % 60:02d}"


def parse_ra(text: bytes) -> float:
    h, m, s = text.rstrip(b"#").split(b":")
    return (int(h) + int(m) / 60 + int(s) / 3600) * 15


def parse_dec(text: bytes) -> float:
    sign = -1 if text[:1] == b"-" else 1
    d, rest = text[1:].rstrip(b"#").split(b"*")
    m, s = rest.split(b":")
    return sign * (int(d) + int(m) / 60 + int(s) / 3600)


def nexstar_angle(degrees: float) -> bytes:
    """The four bytes of a latitude or longitude."""
    seconds = round(abs(degrees) * 3600)
    return bytes((seconds // 3600, seconds // 60 % 60, seconds % 60, int(degrees < 0)))


def degrees_of(raw: bytes) -> float:
    return (raw[0] + raw[1] / 60 + raw[2] / 3600) * (-1 if raw[3] else 1)


def nexstar_clock(local: datetime, offset: float, dst: int) -> bytes:
    """The eight bytes of a local time, which is ``offset`` hours ahead of UTC, summer time included."""
    date = (local.month, local.day, local.year - 2000)
    return bytes((local.hour, local.minute, local.second, *date, int(offset - dst) % 256, dst))


def unix_of(told: bytes) -> float:
    """Unix seconds of the eight bytes of a clock."""
    hour, minute, second, month, day, year, zone, dst = told[:8]
    local = calendar.timegm((2000 + year, month, day, hour, minute, second))
    return local - ((zone - 256 if zone > 127 else zone) + dst) * 3600.0


class Face:
    """An LX200 or a NexStar program. Directions are n, s, e, w."""

    def __init__(self, bridge: Bridge, client: RehearsalClient, nexstar: bool = False) -> None:
        self.bridge, self.client, self.nexstar = bridge, client, nexstar

    @property
    def of_motors(self) -> bool:
        """Whether its arrows name motors and their senses, not the sky."""
        return self.nexstar

    async def begin(self) -> None:
        """Do what every program does first."""

    async def place(self) -> tuple[float, float]:
        if self.nexstar:
            seen = equatorial(await self.client.ask(b"e", ending=b"#"))
            return seen.ra, seen.dec
        return parse_ra(await self.client.ask(b":GR#")), parse_dec(await self.client.ask(b":GD#"))

    def _order(self, letter: str, command: str, ra: float, dec: float) -> bytes:
        if self.nexstar:
            ticks = (round(part / 360 * 2**24) % 2**24 for part in (ra, dec))
            return (letter + "{:06X}00,{:06X}00".format(*ticks)).encode()
        return f":Sr{hms(ra)}#:Sd{dms(dec)}#:{command}#".encode()

    async def goto(self, ra: float, dec: float) -> None:
        """Sent there, and there when the program is told so."""
        await self.leave(ra, dec)
        for _ in range(150):
            if await self.client.ask(b"L" if self.nexstar else b":D#") in (b"0#", b"#"):
                return
            await asyncio.sleep(2.0)
        raise AssertionError("the goto never ends")

    async def sync(self, ra: float, dec: float) -> None:
        assert (await self.client.ask(self._order("s", "CM", ra, dec), 15.0, ending=b"#")).startswith(
            b"#" if self.nexstar else b"11"
        )

    async def stop(self) -> None:
        if self.nexstar:
            for said in (b"M", b"P\x02\x10\x24\0\0\0\0", b"P\x02\x11\x24\0\0\0\0"):
                assert await self.client.ask(said) == b"#"
        else:
            self.client.send(b":Q#")

    async def set_site(self, latitude: float, longitude: float) -> None:
        if self.nexstar:
            assert await self.client.ask(b"W" + nexstar_angle(latitude) + nexstar_angle(longitude)) == b"#"
        else:
            west = round(-longitude * 60) % 21600
            said = f":St{dms(latitude)[:6]}#:Sg{west // 60:03d}*{west % 60:02d}#"
            assert await self.client.ask(said.encode(), ending=b"11") == b"11"

    async def site(self) -> tuple[float, float]:
        if self.nexstar:
            told = await self.client.ask(b"w")
            return degrees_of(told[:4]), degrees_of(told[4:8])
        north, west = await self.client.ask(b":Gt#"), await self.client.ask(b":Gg#")
        sign = b"" if west[:1] in b"+-" else b"+"
        return parse_dec(north.rstrip(b"#") + b":00#"), -parse_dec(sign + west.rstrip(b"#") + b":00#")

    async def set_clock(self, unix: float, offset: float, dst: int) -> None:
        local = datetime.fromtimestamp(unix, UTC) + timedelta(hours=offset)
        if self.nexstar:
            assert await self.client.ask(b"H" + nexstar_clock(local, offset, dst)) == b"#"
        else:
            said = f":SG{-offset:+05.1f}#:SL{local:%H:%M:%S}#:SC{local:%m/%d/%y}#"
            assert (await self.client.ask(said.encode(), 30.0, ending=b" #")).startswith(b"111")

    async def clock(self) -> float:
        """Unix seconds."""
        if self.nexstar:
            return unix_of(await self.client.ask(b"h"))
        answers = [(await self.client.ask(said)).rstrip(b"#").decode() for said in (b":GC#", b":GL#", b":GG#")]
        local = datetime.strptime(" ".join(answers[:2]), "%m/%d/%y %H:%M:%S")
        return calendar.timegm(local.timetuple()) + float(answers[2]) * 3600.0

    async def leave(self, ra: float, dec: float) -> None:
        said = await self.client.ask(self._order("r", "MS", ra, dec), 15.0, ending=b"#" if self.nexstar else b"110")
        if said != (b"#" if self.nexstar else b"110"):
            raise Refusal(said.decode("latin-1"))

    async def arrow(self, direction: str, seconds: float) -> None:
        if self.nexstar:
            device, code = (b"\x11" if direction in "ns" else b"\x10"), (b"\x24" if direction in "nw" else b"\x25")
            await self._yes(b"P\x02" + device + code + b"\x07\0\0\0")
            await asyncio.sleep(seconds)
            await self._yes(b"P\x02" + device + code + b"\0\0\0\0")
        else:
            self.client.send(f":RM#:M{direction}#".encode())
            await asyncio.sleep(seconds)
            self.client.send(f":Q{direction}#".encode())

    async def _yes(self, said: bytes) -> None:
        if (heard := await self.client.ask(said)) != b"#":
            raise Refusal(repr(heard))

    async def pulse(self, direction: str, ms: int) -> None:
        if self.nexstar:
            rate = (50 if direction in "nw" else -50) % 256
            await self._yes(
                b"P\x03" + (b"\x11" if direction in "ns" else b"\x10") + b"\x26" + bytes((rate, ms // 10, 0, 0))
            )
        else:
            self.client.send(f":Mg{direction}{ms:04d}#".encode())

    async def tracking(self, on: bool) -> None:
        equatorial = self.bridge.sim.mechanics.build is not Build.ALTAZ
        if self.nexstar:
            north = self.bridge.sim.mechanics.sky.latitude > 0
            await self._yes(b"T" + bytes((0 if not on else 1 if not equatorial else 2 if north else 3,)))
        else:
            self.client.send(b":AL#" if not on else b":AP#" if equatorial else b":AA#")

    park: Any = None
    unpark: Any = None


class Lx200(Face):
    async def park(self) -> None:
        self.client.send(b":hP#")

    async def unpark(self) -> None:
        self.client.send(b":hW#")


class Stellarium(Face):
    """Positions are pushed, in J2000; it has gotos and nothing else."""

    sync = stop = arrow = pulse = tracking = set_site = site = set_clock = clock = None  # type: ignore[assignment]

    def _of_date(self, ra: float, dec: float) -> tuple[float, float]:
        return Sky().from_j2000(ra, dec, self.bridge.clock())

    async def place(self) -> tuple[float, float]:
        self.client.received = b""
        while len(self.client.received) < 24:
            await asyncio.sleep(0.1)
        _, _, _, ra, dec, _ = struct.unpack("<HHQIii", self.client.received[-24:])
        return self._of_date(ra * 360.0 / 2**32, dec * 360.0 / 2**32)

    async def leave(self, ra: float, dec: float) -> None:
        ra, dec = Sky().to_j2000(ra, dec, self.bridge.clock())
        self.client.send(
            struct.pack("<HHQIi", 20, 0, 0, round(wrap360(ra) * 2**32 / 360.0) % 2**32, round(dec * 2**32 / 360.0))
        )
        self.client.received = b""
        await asyncio.sleep(3.0)
        if struct.unpack("<i", self.client.received[-4:])[0] < 0:
            raise Refusal("status")

    async def goto(self, ra: float, dec: float) -> None:
        await self.leave(ra, dec)
        while self.bridge.sim.slewing:
            await asyncio.sleep(1.0)


class Alpaca(Face):
    """Its requests are the lines of the gateway's own table."""

    of_motors = True  # type: ignore[assignment]

    async def _ask(self, line: str, seconds: float = 10.0) -> Any:
        told = json.loads(await self.client.ask(line.encode() + b"\n", seconds, ending=b"\n") or b"null")
        if isinstance(told, dict) and "ErrorNumber" in told:
            raise Refusal(f"{told['ErrorNumber']:#x} {told['ErrorMessage']}")
        return told

    async def begin(self) -> None:
        await self._ask("put connected Connected=true")

    async def place(self) -> tuple[float, float]:
        return await self._ask("get rightascension") * 15.0, await self._ask("get declination")

    async def leave(self, ra: float, dec: float) -> None:
        await self._ask(f"put slewtocoordinatesasync RightAscension={ra / 15.0:.7f} Declination={dec:.7f}")

    async def goto(self, ra: float, dec: float) -> None:
        await self.leave(ra, dec)
        for _ in range(150):
            await asyncio.sleep(2.0)
            if not await self._ask("get slewing"):
                return
        raise AssertionError("the goto never ends")

    async def sync(self, ra: float, dec: float) -> None:
        await self._ask(f"put synctocoordinates RightAscension={ra / 15.0:.7f} Declination={dec:.7f}")

    async def stop(self) -> None:
        await self._ask("put abortslew")

    async def arrow(self, direction: str, seconds: float) -> None:
        axis, rate = int(direction in "ns"), 1.0 if direction in "nw" else -1.0
        rates = await self._ask(f"get axisrates Axis={axis}")
        if not rates:
            raise Refusal("no AxisRates")
        speed = max(min(one["Maximum"], 1.0) for one in rates if one["Minimum"] <= 1.0)
        await self._ask(f"put moveaxis Axis={axis} Rate={speed * rate}")
        await asyncio.sleep(seconds)
        await self._ask(f"put moveaxis Axis={axis} Rate=0")

    async def pulse(self, direction: str, ms: int) -> None:
        await self._ask(f"put pulseguide Direction={'nsew'.index(direction)} Duration={ms}")

    async def tracking(self, on: bool) -> None:
        await self._ask(f"put tracking Tracking={str(on).lower()}")

    async def park(self) -> None:
        await self._ask("put park")

    async def unpark(self) -> None:
        await self._ask("put unpark")

    async def set_site(self, latitude: float, longitude: float) -> None:
        await self._ask(f"put sitelatitude SiteLatitude={latitude}")
        await self._ask(f"put sitelongitude SiteLongitude={longitude}")

    async def site(self) -> tuple[float, float]:
        return await self._ask("get sitelatitude"), await self._ask("get sitelongitude")

    async def set_clock(self, unix: float, offset: float, dst: int) -> None:
        await self._ask(f"put utcdate UTCDate={datetime.fromtimestamp(unix, UTC).isoformat().replace('+00:00', 'Z')}")

    async def clock(self) -> float:
        return datetime.fromisoformat(await self._ask("get utcdate")).timestamp()


def face(name: str, bridge: Bridge) -> Face:
    made = {"lx200": Lx200, "nexstar": Face, "stellarium": Stellarium, "alpaca": Alpaca}[name]
    return made(bridge, bridge.client(), name == "nexstar")
