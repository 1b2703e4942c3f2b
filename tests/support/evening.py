"""One evening on a mount through each surface, step by step, judged by the simulated mount itself.

``python -m tests.support.evening [MODEL…]`` prints the table. A step is a figure, ``refused: why`` or
WRONG; what a protocol has no command for is ``-``.
"""

from __future__ import annotations

import asyncio
import json
import struct
import sys
from collections.abc import Awaitable, Callable
from datetime import UTC, datetime
from typing import Any

from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation, wrap180, wrap360
from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.diagnostics.virtual_time import run
from gateway.protocols.wireformat import sexagesimal
from tests.support.in_process_gateway import EVENING, Bridge, Visitor
from tests.support.owner import Cable

SITE = 45.0, 10.0
ARCSECOND = 1.0 / 3600.0
#: Arcseconds: what whole seconds of right ascension lose, and a few seconds of time of a motion that is read.
EXACT = 16.0
MODELS = ("onstep", "teenastro")
SYNSCANS = ("synscan",)
#: The keys of the mount's own keypad that switch tracking off and on, as commands on another connection.
KEYPAD = {"lx200": (b":Td#", b":Te#"), "nexstar": (b"T\0", b"T\2")}
NONE = "-"


class Face:
    """A program at a surface; the bytes are typed by hand."""

    surface = ""

    def __init__(self, client: Visitor) -> None:
        self.client = client

    async def connect(self) -> None: ...
    async def place(self) -> tuple[float, float]:
        raise NotImplementedError

    async def goto(self, ra: float, dec: float) -> str:
        """Begin a goto; return the refusal, or nothing."""
        raise NotImplementedError


class Lx200(Face):
    surface = "lx200"

    async def place(self) -> tuple[float, float]:
        ra, dec = await self.client.ask(b":GR#"), await self.client.ask(b":GD#")
        return sexagesimal.parse_hours(ra[:-1]), sexagesimal.parse(dec[:-1])

    def _target(self, ra: float, dec: float) -> bytes:
        return f":Sr{sexagesimal.hours(ra)}#:Sd{sexagesimal.signed(dec)}#".encode()

    async def goto(self, ra: float, dec: float) -> str:
        told = await self.client.ask(self._target(ra, dec) + b":MS#", 15.0, until=b"110")
        return "" if told.endswith(b"110") else told[2:].decode()

    async def sync(self, ra: float, dec: float) -> None:
        assert (await self.client.ask(self._target(ra, dec) + b":CM#", until=b"#")).startswith(b"11")

    async def stop(self) -> None:
        self.client.tell(b":Q#")

    async def arrow(self) -> None:
        self.client.tell(b":RS#:Mn#")

    async def tap(self) -> None:
        self.client.tell(b":RC#:Mn#")
        await asyncio.sleep(0.3)
        self.client.tell(b":Qn#")

    async def pulse(self) -> float:
        self.client.tell(b":Mgn2000#")
        return 2.0

    async def park(self) -> None:
        self.client.tell(b":hP#")

    async def unpark(self) -> None:
        self.client.tell(b":hW#")

    async def tracking(self, on: bool) -> None:
        self.client.tell(b":AP#" if on else b":AL#")

    async def site(self) -> tuple[float, float]:
        north, west = await self.client.ask(b":Gt#"), await self.client.ask(b":Gg#")
        return sexagesimal.parse(north[:-1]), -sexagesimal.parse_longitude(west[:-1])

    async def set_site(self) -> None:
        assert await self.client.ask(b":St+46*00#:Sg349*00#", until=b"11") == b"11"

    async def set_clock(self, unix: float) -> None:
        at = datetime.fromtimestamp(unix, UTC)
        await self.client.ask(f":SG+00.0#:SL{at:%H:%M:%S}#:SC{at:%m/%d/%y}#".encode(), 30.0, until=b" #")


class NexStar(Face):
    surface = "nexstar"

    def _words(self, letter: str, ra: float, dec: float) -> bytes:
        ticks = (round(part / 360 * 2**24) % 2**24 for part in (ra, dec))
        return (letter + "{:06X}00,{:06X}00".format(*ticks)).encode()

    async def place(self) -> tuple[float, float]:
        told = (await self.client.ask(b"e", until=b"#"))[:-1]
        ra, dec = (int(part, 16) * 360.0 / 2**32 for part in told.split(b","))
        return ra, wrap180(dec)

    async def goto(self, ra: float, dec: float) -> str:
        assert await self.client.ask(self._words("r", ra, dec), 15.0, until=b"#") == b"#"
        return ""

    async def sync(self, ra: float, dec: float) -> None:
        assert await self.client.ask(self._words("s", ra, dec), until=b"#") == b"#"

    async def stop(self) -> None:
        for said in (b"M", b"P\x02\x10\x24\0\0\0\0", b"P\x02\x11\x24\0\0\0\0"):
            assert await self.client.ask(said) == b"#"

    async def arrow(self) -> None:
        assert await self.client.ask(b"P\x02\x11\x24\x09\0\0\0") == b"#"

    async def tap(self) -> None:
        assert await self.client.ask(b"P\x02\x11\x24\x05\0\0\0") == b"#"
        await asyncio.sleep(0.3)
        assert await self.client.ask(b"P\x02\x11\x24\0\0\0\0") == b"#"

    async def pulse(self) -> float:
        assert await self.client.ask(b"P\x03\x11\x26\x64\x64\0\0") == b"#"  # 100 % of sidereal, 1 s
        return 1.0

    async def tracking(self, on: bool) -> None:
        assert await self.client.ask(b"T\2" if on else b"T\0") == b"#"

    async def site(self) -> tuple[float, float]:
        told = await self.client.ask(b"w", until=b"#")
        return _degrees(told[:4]), _degrees(told[4:8])

    async def set_site(self) -> None:
        assert await self.client.ask(b"W\x2e\0\0\0\x0b\0\0\0") == b"#"

    async def set_clock(self, unix: float) -> None:
        at = datetime.fromtimestamp(unix, UTC)
        fields = bytes((at.hour, at.minute, at.second, at.month, at.day, at.year - 2000, 0, 0))
        assert await self.client.ask(b"H" + fields) == b"#"

    async def unpark(self) -> None:
        assert await self.client.ask(b"y") == b"#"


def _degrees(raw: bytes) -> float:
    return (raw[0] + raw[1] / 60 + raw[2] / 3600) * (-1 if raw[3] else 1)


class Alpaca(Face):
    surface = "alpaca"

    async def _ask(self, line: str) -> Any:
        told = json.loads(await self.client.ask(line.encode() + b"\n", 20.0, until=b"\n"))
        if isinstance(told, dict) and told.get("ErrorNumber"):
            raise Fault(told["ErrorMessage"])
        return told

    async def connect(self) -> None:
        await self._ask("put connected Connected=True")

    async def place(self) -> tuple[float, float]:
        return 15.0 * await self._ask("get rightascension"), await self._ask("get declination")

    async def goto(self, ra: float, dec: float) -> str:
        try:
            await self._ask(f"put slewtocoordinatesasync RightAscension={ra / 15.0} Declination={dec}")
        except Fault as fault:
            return str(fault)
        return ""

    async def sync(self, ra: float, dec: float) -> None:
        await self._ask(f"put synctocoordinates RightAscension={ra / 15.0} Declination={dec}")

    async def stop(self) -> None:
        await self._ask("put abortslew")

    async def arrow(self) -> None:
        rates = await self._ask("get axisrates Axis=1")
        await self._ask(f"put moveaxis Axis=1 Rate={rates[-1]['Maximum']}")

    async def tap(self) -> None:
        await self._ask("put moveaxis Axis=1 Rate=0.05")
        await asyncio.sleep(0.3)
        await self._ask("put moveaxis Axis=1 Rate=0")

    async def pulse(self) -> float:
        await self._ask("put pulseguide Direction=0 Duration=2000")
        return 2.0 * await self._ask("get guideratedeclination") * 3600.0 / 15.041067

    async def park(self) -> None:
        await self._ask("put park")

    async def unpark(self) -> None:
        await self._ask("put unpark")

    async def tracking(self, on: bool) -> None:
        await self._ask(f"put tracking Tracking={on}")

    async def site(self) -> tuple[float, float]:
        return await self._ask("get sitelatitude"), await self._ask("get sitelongitude")

    async def set_site(self) -> None:
        await self._ask("put sitelatitude SiteLatitude=46")
        await self._ask("put sitelongitude SiteLongitude=11")

    async def set_clock(self, unix: float) -> None:
        await self._ask(f"put utcdate UTCDate={datetime.fromtimestamp(unix, UTC):%Y-%m-%dT%H:%M:%SZ}")


class Stellarium(Face):
    """Its coordinates are those of J2000; it has nothing but positions and gotos."""

    surface = "stellarium"
    sky = Sky()

    async def place(self) -> tuple[float, float]:
        self.client.heard = b""
        await asyncio.sleep(1.1)
        ra, dec = struct.unpack("<Ii", self.client.heard[-24:][12:20])
        return self.sky.to_of_date(ra * 360.0 / 2**32, dec * 360.0 / 2**32, EVENING)

    async def goto(self, ra: float, dec: float) -> str:
        ra, dec = self.sky.to_j2000(ra, dec, EVENING)
        place = struct.pack("<Ii", int(ra / 360.0 * 2**32), int(dec / 360.0 * 2**32))
        self.client.tell(struct.pack("<HHQ", 20, 0, 0) + place)
        await asyncio.sleep(1.0)
        return ""


FACES: dict[str, type[Face]] = {face.surface: face for face in (Lx200, NexStar, Alpaca, Stellarium)}


def truth(b: Bridge) -> tuple[float, float]:
    """Return what the mount believes to point at, which is the truth but for its syncs."""
    b.sim.truth()
    return b.sim.mechanics.believed(b.sim.now)


def off(one: tuple[float, float], other: tuple[float, float]) -> float:
    return separation(*one, *other) / ARCSECOND


async def settle(b: Bridge) -> None:
    for _ in range(200):
        await asyncio.sleep(1.0)
        if not b.sim.slewing and not b.controller.driver.goto:
            return


class Evening:
    """The steps, in order; each returns a figure in words, or raises what it was refused with."""

    def __init__(self, bridge: Bridge, face: Face, cable: Cable, driven: str) -> None:
        self.b, self.face, self.cable, self.driven = bridge, face, cable, driven

    def _goal(self, east: float, dec: float = 30.0) -> tuple[float, float]:
        ra = wrap360(self.b.sim.mechanics.sky.sidereal(self.b.clock()) + east)
        return round(ra * 240.0) / 240.0, dec

    async def position(self) -> str:
        return self._within(off(await self.face.place(), truth(self.b)), EXACT)

    def _within(self, arcseconds: float, most: float) -> str:
        return f"{'' if arcseconds <= most else 'WRONG '}{arcseconds:.0f}″"

    async def goto(self) -> str:
        goal = self._goal(30.0)
        if no := await self.face.goto(*goal):
            raise Fault(no)
        await settle(self.b)
        await asyncio.sleep(2.0)
        there = truth(self.b) if self.b.sim.mechanics.correction != (0.0, 0.0) else self.b.sim.truth()
        return self._within(max(off(there, goal), off(await self.face.place(), goal)), EXACT)

    async def abort(self) -> str:
        await self.face.goto(*self._goal(-60.0, 0.0))
        await asyncio.sleep(3.0)
        assert self.b.sim.slewing, "WRONG: no goto"
        await self.face.stop()  # type: ignore[attr-defined]
        await asyncio.sleep(4.0)
        stood = truth(self.b)
        await asyncio.sleep(3.0)
        assert not self.b.sim.slewing and self.b.sim.tracking, "WRONG: it goes on, or does not track"
        return self._within(off(truth(self.b), stood), EXACT)

    async def again(self) -> str:
        """A goto just after an abort."""
        return await self.goto()

    async def sync(self) -> str:
        ra, dec = truth(self.b)
        there = round((ra + 0.3) * 240.0) / 240.0, round((dec + 0.3) * 3600.0) / 3600.0
        await self.face.sync(*there)  # type: ignore[attr-defined]
        await asyncio.sleep(2.0)
        return self._within(off(await self.face.place(), there), EXACT)

    async def arrow(self) -> str:
        """Held for 25 s, which an OnStep ends after 10."""
        before = truth(self.b)[1]
        await self.face.arrow()  # type: ignore[attr-defined]
        await asyncio.sleep(10.0)
        at = truth(self.b)[1]
        await asyncio.sleep(15.0)
        after = truth(self.b)[1]
        await self.face.stop()  # type: ignore[attr-defined]
        await asyncio.sleep(4.0)
        stood = truth(self.b)[1]
        await asyncio.sleep(3.0)
        assert abs(truth(self.b)[1] - stood) < 0.01, "WRONG: it moves on"
        speed = abs(after - before) / 25.0
        assert speed > 0.5 * abs(at - before) / 10.0 > 0.001, "WRONG: it has ended"
        return f"{speed:.2f}°/s"

    async def tap(self) -> str:
        before = truth(self.b)[1]
        await self.face.tap()  # type: ignore[attr-defined]
        await asyncio.sleep(3.0)
        moved = abs(truth(self.b)[1] - before) * 60.0
        assert 0.0 < moved < 6.0, f"WRONG {moved:.2f}′"
        return f"{moved:.2f}′"

    async def pulse(self) -> str:
        before = truth(self.b)[1]
        seconds = await self.face.pulse()  # type: ignore[attr-defined]
        await asyncio.sleep(6.0)
        rate = abs(truth(self.b)[1] - before) * 3600.0 / seconds / 15.041067
        assert 0.4 < rate < 1.1, f"WRONG {rate:.2f}"
        return f"{rate:.2f} sidereal"

    async def tracking(self) -> str:
        await self.face.tracking(False)  # type: ignore[attr-defined]
        await asyncio.sleep(3.0)
        off_ = self.b.sim.tracking
        await self.face.tracking(True)  # type: ignore[attr-defined]
        await asyncio.sleep(3.0)
        assert not off_ and self.b.sim.tracking, "WRONG"
        return "off, on"

    async def settings(self) -> str:
        """The site and the clock of the mount, as it is told."""
        seen = await self.face.site()  # type: ignore[attr-defined]
        return self._within(max(abs(seen[0] - SITE[0]), abs(seen[1] - SITE[1])) * 3600.0, 61.0)

    async def set_clock(self) -> str:
        await self.face.set_clock(self.b.clock() + 90.0)  # type: ignore[attr-defined]
        await asyncio.sleep(12.0)
        ahead = self.b.sim.utc() - self.b.sim.now
        assert abs(ahead - 90.0) < 3.0, f"WRONG {ahead:.0f} s"
        await self.face.set_clock(self.b.clock())  # type: ignore[attr-defined]
        await asyncio.sleep(12.0)
        return "0 s"

    async def set_site(self) -> str:
        """Another one, which a SynScan takes at any time."""
        if self.driven != "nexstar":
            return NONE
        await self.face.set_site()  # type: ignore[attr-defined]
        await asyncio.sleep(12.0)
        site = self.b.sim.mechanics.sky
        return self._within(max(abs(site.latitude - 46.0), abs(site.longitude - 11.0)) * 3600.0, 61.0)

    async def limits(self) -> str:
        """A goto below the mount's own horizon, which the gateway was told to allow. A German SynScan has none."""
        if self.driven == "nexstar":
            return NONE
        lowest, self.b.sim.kept["lowest"] = self.b.sim.kept["lowest"], 60.0
        stood = truth(self.b)
        no = await self.face.goto(*self._goal(50.0, 0.0))
        await asyncio.sleep(2.0)
        self.b.sim.kept["lowest"] = lowest
        assert off(truth(self.b), stood) < EXACT, "WRONG: it went"
        raise Fault(no or "in the log")

    async def owner(self) -> str:
        """Tracking is switched off at the mount's own keypad: told within seconds."""
        off_, on = KEYPAD[self.driven]
        self.b.sim.feed(off_)
        await asyncio.sleep(8.0)
        told = (await self.b.controller.perform(op.GetStatus())).tracking is op.Tracking.OFF
        self.b.sim.feed(on)
        await asyncio.sleep(8.0)
        assert told and (await self.b.controller.perform(op.GetStatus())).tracking is not op.Tracking.OFF, "WRONG"
        return "seen"

    async def lost_line(self) -> str:
        """The cable is out for half a minute during a goto: the mount is stopped first."""
        await self.face.goto(*self._goal(-70.0, 0.0))
        await asyncio.sleep(2.0)
        self.cable.pull()
        await asyncio.sleep(5.0)
        self.cable.out = False
        await asyncio.sleep(30.0)
        assert not self.b.sim.slewing, "WRONG: it slews on"
        return self._within(off(await self.face.place(), truth(self.b)), EXACT)

    async def park(self) -> str:
        await self.face.park()  # type: ignore[attr-defined]
        await settle(self.b)
        await asyncio.sleep(4.0)
        assert self.b.controller.driver.parked and not self.b.sim.tracking, "WRONG: not parked"
        if self.driven == "nexstar":  # it knows of no park: the next goto of some programs takes it up again
            if isinstance(self.face, Alpaca):
                assert await self.face.goto(*self._goal(30.0)), "WRONG: parked, it goes"
            await self.face.unpark()  # type: ignore[attr-defined]
            await asyncio.sleep(4.0)
            assert self.b.sim.tracking, "WRONG: not unparked"
            return "parked, unparked"
        if not await self.face.goto(*self._goal(30.0)):
            await asyncio.sleep(2.0)
        assert self.b.controller.driver.parked and not self.b.sim.slewing, "WRONG: parked, it goes"
        await self.face.unpark()  # type: ignore[attr-defined]
        await asyncio.sleep(4.0)
        assert not self.b.controller.driver.parked and self.b.sim.tracking, "WRONG: not unparked"
        return "parked, unparked"


STEPS: tuple[str, ...] = (
    "position", "goto", "abort", "again", "sync", "arrow", "tap", "pulse", "tracking", "settings", "set_clock",
    "limits", "owner", "lost_line", "park", "set_site",
)  # fmt: skip


async def evening(model: str, face: str, steps: tuple[str, ...] = STEPS) -> dict[str, str]:
    """Return step -> outcome of one evening."""
    config = {"site_time": "always", "lowest": -90.0, "sun": 0.0}
    driven = "nexstar" if model in SYNSCANS else "lx200"
    named = "cge" if driven == face else None  # a SynScan presents itself in J2000 otherwise
    bridge = Bridge(
        model,
        driven=driven,
        presented=face,
        surface=named if driven == "nexstar" else None,
        config=config,
        site=SITE,
        latency=0.02,
    )
    cable = bridge.controller.line.wire = Cable(bridge.controller.line.wire)
    outcomes = {}
    async with bridge:
        bridge.controller.astrometry.sky.load()
        program = FACES[face](bridge.client())
        await program.connect()
        one = Evening(bridge, program, cable, driven)
        for step in steps:
            doing: Callable[[], Awaitable[str]] = getattr(one, step)
            try:
                outcomes[step] = await doing()
            except AttributeError as error:
                if error.obj is not program:
                    raise
                outcomes[step] = NONE
            except AssertionError as error:
                outcomes[step] = f"WRONG {error}".replace("WRONG WRONG", "WRONG")
            except Fault as fault:
                outcomes[step] = f"refused: {fault}"
    return outcomes


def main() -> None:
    for model in sys.argv[1:] or (*SYNSCANS, *MODELS):
        for face in FACES:
            for step, outcome in run(evening(model, face)).items():
                print(f"{model:10} {face:10} {step:10} {outcome}")


if __name__ == "__main__":
    main()
