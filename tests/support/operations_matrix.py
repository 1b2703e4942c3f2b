"""Performs every operation on one driven mount, through controller, driver and link, and checks the effect.

Each check performs its operation and returns whether the simulator shows its effect. A fault is a valid outcome too: it
names what the mount cannot do. Only ``nothing`` is a failure: no fault and no effect.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from gateway.astro.axes import Build
from gateway.astro.spherical import SIDEREAL_RATE, fold_declination, separation, wrap180
from gateway.core import operations as op
from gateway.core.errors import Fault, Refused
from gateway.protocols.alpaca.simulator.server import SimulatedAlpaca
from gateway.protocols.nexstar.simulator.mount import FocuserMotor
from gateway.protocols.wireformat.command_set import load
from tests.support.in_process_gateway import Bridge

Check = Callable[[Bridge], Awaitable[bool]]
LUNAR = 14.685 / 15.041067


def _axes(b: Bridge) -> tuple[float, float]:
    b.sim.true_position()
    first, second = b.sim.mechanics.axes(b.sim.now)
    return float(first), float(second)


def _place(b: Bridge) -> tuple[float, float]:
    b.sim.true_position()
    ra, dec = b.sim.mechanics.believed_position(b.sim.now)
    return fold_declination(ra, dec)


def _near(one: tuple[float, float], other: tuple[float, float], within: float = 0.1) -> bool:
    return abs(wrap180(one[0] - other[0])) < within and abs(one[1] - other[1]) < within


def _site(b: Bridge) -> tuple[float, float]:
    """Return the site that the mount believes in."""
    return b.sim.mechanics.sky[:2]


def _alpaca(b: Bridge) -> bool:
    return isinstance(b.sim, SimulatedAlpaca)


def _high(b: Bridge, east: float = 20.0) -> tuple[float, float]:
    """Return a target well above the horizon, ``east`` degrees east of the meridian."""
    return (b.sim.mechanics.sky.lst(b.clock()) + east) % 360.0, 0.5 * _site(b)[0]


async def _settle(b: Bridge, seconds: float = 240.0) -> None:
    for _ in range(int(seconds)):
        await asyncio.sleep(1.0)
        if not b.sim.slewing and not await b.controller.answer(op.Slewing()):
            return


async def _rate(b: Bridge, seconds: float) -> tuple[float, float]:
    """Return the speed of right ascension and declination, degrees an hour."""
    before = _place(b)
    await asyncio.sleep(seconds)
    after = _place(b)
    return wrap180(after[0] - before[0]) / seconds * 3600, (after[1] - before[1]) / seconds * 3600


async def position(b: Bridge) -> bool:
    seen = await b.controller.answer(op.Position())
    return separation(seen.ra, seen.dec, *_place(b)) < 0.2


async def horizon(b: Bridge) -> bool:
    seen = await b.controller.answer(op.HorizontalPosition())
    here = b.controller.astrometry.horizontal(await b.controller.answer(op.Position()))
    return _near((seen.az, seen.alt), (here.az, here.alt), 0.3)


async def axis_position(b: Bridge) -> bool:
    seen = await b.controller.answer(op.AxisPosition())
    return seen.alt <= 180 or seen.alt >= 270


async def slewing(b: Bridge) -> bool:
    return (await b.controller.answer(op.Slewing())) is False


async def status(b: Bridge) -> bool:
    seen = await b.controller.answer(op.GetStatus())
    return bool(seen.aligned) and (seen.tracking is not op.Tracking.OFF) is b.sim.tracking


async def identity(b: Bridge) -> bool:
    """As in the manuals: a classic LX200 reports neither product nor firmware, a hand control before 2.2 no model."""
    seen = await b.controller.answer(op.GetIdentity())
    if _alpaca(b):
        return bool(seen.product == "Simulated mount")
    if hasattr(b.sim, "reported_version"):
        name = next(model for model, row in load("nexstar").models.items() if row is b.sim.facts)
        major, minor, *patch = b.sim.reported_version
        named = b.sim.version >= (2, 2) or major >= 100  # only a GT counts from 100
        version = f"{major}.{minor:02d}" if 3 <= major < 100 else f"{major}.{minor}"
        if name.startswith("synscan"):  # six digits, two for each number
            patch = patch or [0]
        hand_control = "Sky-Watcher SynScan" if name.startswith("synscan") else "Celestron NexStar"
        return (seen.product, seen.version, seen.model) == (
            "Celestron StarSense" if b.sim.starsense else hand_control,
            version + "".join(f".{number:02d}" for number in patch),
            name if named else "unknown",
        )
    product, firmware = ("LX200", "?") if b.sim.classic else (b.sim.facts["product"], b.sim.facts["firmware"])
    return (seen.product, seen.version, seen.model) == (product, firmware, b.sim.model)


async def site(b: Bridge) -> bool:
    seen = await b.controller.answer(op.GetSite())
    return _near((seen.latitude, seen.longitude), _site(b))


async def clock(b: Bridge) -> bool:
    return abs((await b.controller.answer(op.GetClock())).unix - b.clock()) < 3.0


async def gps(b: Bridge) -> bool:
    seen = await b.controller.answer(op.GetGps())
    return (
        seen.linked
        and _near((seen.place.latitude, seen.place.longitude), _site(b))
        and abs(seen.unix - b.clock()) < 3.0
    )


async def sidereal(b: Bridge) -> bool:
    return abs(wrap180(await b.controller.answer(op.SiderealTime()) - b.sim.mechanics.sky.lst(b.clock()))) < 0.05


async def pier_side(b: Bridge) -> bool:
    """West of a northern pier the declination axis of a German mount reads beyond the pole; a fork is always E."""
    await b.controller.answer(op.PierSide())
    sides = []
    for east in (-30.0, 30.0):
        await b.controller.perform(op.Goto(*_high(b, east)))
        await _settle(b)
        beyond = b.sim.mechanics.build is Build.GERMAN and wrap180(_axes(b)[1] - 90.0) > 0.0
        sides.append(await b.controller.answer(op.PierSide()) == ("W" if beyond else "E"))
    return all(sides)


async def guide_rate(b: Bridge) -> bool:
    """In 1/256 of sidereal, the motor's unit; set behind the gateway's back."""
    now = await b.controller.answer(op.GuideRate(1))
    if _alpaca(b):
        return abs(now - b.sim.guides[0] / SIDEREAL_RATE) < 0.01
    told = []
    for axis, rate in ((1, 0x40), (2, 0xC0)):
        b.sim.settings["guide rate", 15 + axis] = rate
        told.append(await b.controller.read_now(op.GuideRate(axis)))
    return told == [0.25, 0.75]


async def goto(b: Bridge) -> bool:
    there = _high(b)
    await b.controller.perform(op.Goto(*there))
    await _settle(b)
    return _near(_place(b), there)


async def goto_horizontal(b: Bridge) -> bool:
    await b.controller.perform(op.GotoHorizontal(150.0 if _site(b)[0] > 0 else 30.0, 50.0))
    await _settle(b)
    return abs((await b.controller.answer(op.HorizontalPosition())).alt - 50.0) < 0.5


async def goto_axes(b: Bridge) -> bool:
    seen = await b.controller.answer(op.AxisPosition())
    before = _axes(b)
    wanted = op.GotoAxes((seen.az + 5.0) % 360.0, wrap180(seen.alt) + (3.0 if wrap180(seen.alt) < 80 else -3.0))
    await b.controller.perform(wanted)
    await _settle(b)
    after = _axes(b)
    return abs(abs(after[1] - before[1]) - 3.0) < 0.5 or abs(abs(wrap180(after[0] - before[0])) - 5.0) < 0.5


async def sync(b: Bridge) -> bool:
    ra, dec = _place(b)
    await b.controller.perform(op.Sync(ra + 1.0, dec - 1.0))
    seen = await b.controller.answer(op.Position())
    return _near((seen.ra, seen.dec), (ra + 1.0, dec - 1.0))


async def _moves(b: Bridge, operation: op.Operation, axis: int) -> bool:
    before = _axes(b)
    await b.controller.perform(operation)
    await asyncio.sleep(4.0)
    await b.controller.perform(op.StopAxis(axis))
    await asyncio.sleep(2.0)
    after = _axes(b)
    rest = 0.0, 90.0
    for _ in range(8):  # some hand controls resume tracking by themselves after a while
        if abs(rest[1]) > 5.0:
            await asyncio.sleep(3.0)
            rest = await _rate(b, 1.0)
    return abs(wrap180(after[axis - 1] - before[axis - 1])) > 0.3 and abs(rest[1]) < 5.0


async def move(b: Bridge) -> bool:
    return await _moves(b, op.Move(op.Direction.NORTH, op.Rate(name="find")), 2)


async def move_axis(b: Bridge) -> bool:
    return await _moves(b, op.MoveAxis(1, 1, op.Rate(key=7)), 1)


async def halt(b: Bridge) -> bool:
    return await _moves(b, op.Move(op.Direction.SOUTH, op.Rate(name="find")), 2)


async def stop(b: Bridge) -> bool:
    await b.controller.perform(op.Goto(*_high(b, 70.0)))
    await asyncio.sleep(2.0)
    await b.controller.perform(op.AbortMotion())
    await asyncio.sleep(1.5)
    return not b.sim.slewing


async def cancel_goto(b: Bridge) -> bool:
    await b.controller.perform(op.Goto(*_high(b, -70.0)))
    await asyncio.sleep(2.0)
    await b.controller.perform(op.AbortSlew())
    await asyncio.sleep(1.5)
    return not b.sim.slewing


async def _guides(b: Bridge, operation: op.Operation) -> bool:
    before = _place(b)[1]
    await b.controller.perform(operation)
    await asyncio.sleep(4.0)
    return abs(_place(b)[1] - before) * 3600.0 > 3.0


async def pulse(b: Bridge) -> bool:
    return await _guides(b, op.Pulse(op.Direction.NORTH, 2000))


async def pulse_axis(b: Bridge) -> bool:
    return await _guides(b, op.PulseAxis(2, 1, 2000, 0.5))


async def drive_rate(b: Bridge) -> bool:
    return abs(await b.controller.answer(op.DriveRate()) - 1.0) < 0.002


async def set_tracking(b: Bridge) -> bool:
    await b.controller.perform(op.SetTracking(on=False))
    off = not b.sim.tracking
    await b.controller.perform(op.SetTracking(on=True))
    return off and b.sim.tracking


async def track_rate(b: Bridge) -> bool:
    """The Moon falls behind the stars by 30 arcminutes of right ascension an hour."""
    await b.controller.perform(op.TrackRate(name="lunar"))
    east, _ = await _rate(b, 15.0)
    await b.controller.perform(op.TrackRate(name="sidereal"))
    await asyncio.sleep(2.0)
    still, _ = await _rate(b, 15.0)
    return 0.2 < east < 0.7 and abs(still) < 0.05


async def park(b: Bridge) -> bool:
    await b.controller.perform(op.Park())
    await _settle(b)
    await asyncio.sleep(2.0)
    if any("cannot turn tracking off" in entry.note for entry in b.entries):
        raise KeepsTracking
    return not b.sim.tracking


async def unpark(b: Bridge) -> bool:
    await b.controller.perform(op.Unpark())
    await asyncio.sleep(2.0)
    return bool(b.sim.tracking)


async def set_home(b: Bridge) -> bool:
    await b.controller.perform(op.SetHome())
    await _settle(b)
    return (await b.controller.answer(op.HomeState())) == 1


async def home(b: Bridge) -> bool:
    await b.controller.perform(op.Goto(*_high(b, 50.0)))
    await _settle(b)
    await b.controller.perform(op.Home())
    await asyncio.sleep(0.2)
    moved = b.sim.slewing
    await _settle(b)
    return moved


async def home_state(b: Bridge) -> bool:
    return await b.controller.answer(op.HomeState()) in (0, 1, 2)


async def sleep(b: Bridge) -> bool:
    await b.controller.perform(op.Hibernate())
    return not b.sim.tracking


async def wake(b: Bridge) -> bool:
    await b.controller.perform(op.Wake())
    await asyncio.sleep(4.0)
    return bool(b.sim.tracking)


async def set_site(b: Bridge) -> bool:
    latitude, longitude = _site(b)
    await b.controller.perform(op.SetSite(latitude - 1.0, longitude + 1.0))
    await asyncio.sleep(5.0)
    sky = b.sim.mechanics.sky
    if not _near((sky.latitude, sky.longitude), (latitude - 1.0, longitude + 1.0)):
        raise _kept(b)
    return True


async def set_clock(b: Bridge) -> bool:
    await b.controller.perform(op.SetClock(b.clock() + 600.0, 2.0))
    await asyncio.sleep(10.0)
    if abs(b.sim.mechanics.sky.clock_ahead - 600.0) > 5.0:
        raise _kept(b)
    return True


def _kept(b: Bridge) -> Fault:
    """The outcome of a site or clock that was not sent: the gateway serves it from then on, and logs why."""
    said = [entry.note for entry in b.entries if entry.note]
    if any("stored in the gateway" in note for note in said):
        return ClientState()
    return Refused("not in force") if any("it is not in force" in note for note in said) else Fault("nothing")


class KeepsTracking(Fault):
    """The log says that the mount has reached its park position and keeps tracking."""


class ClientState(Fault):
    """The gateway itself serves the value from now on."""


async def clock_from_gps(b: Bridge) -> bool:
    await b.controller.perform(op.ClockFromGps())
    return abs(b.sim.mechanics.sky.clock_ahead) < 3.0


async def set_guide_rate(b: Bridge) -> bool:
    await b.controller.perform(op.SetGuideRate(1, 0.25))
    if hasattr(b.sim, "pulse_rate_number"):  # that of the next pulse
        await b.controller.perform(op.Pulse(op.Direction.NORTH, 1000))
        return bool(b.sim.times(b.sim.pulse_rate_number) == 0.25)
    if _alpaca(b):
        return bool(abs(b.sim.guides[0] / SIDEREAL_RATE - 0.25) < 0.01)
    return (
        bool(b.sim.settings["guide rate", 16] == 64)
        if hasattr(b.sim, "settings")
        else bool(abs(b.sim.stored_values["Rg"] - 3.8) < 0.1)
    )


async def backlash(b: Bridge) -> bool:
    await b.controller.perform(op.Backlash(2, 25))
    if hasattr(b.sim, "settings"):
        return bool(b.sim.settings["positive backlash", 17] == b.sim.settings["negative backlash", 17] == 25)
    return bool(b.sim.accessories["backlash 2"] == 25)


async def periodic_error(b: Bridge) -> bool:
    for _ in range(2):  # sent twice: a toggle must not switch back
        await b.controller.perform(op.PeriodicError(1, True))
    if hasattr(b.sim, "settings"):
        return bool(b.sim.settings["periodic error", 16] == 1)
    return bool(b.sim.accessories["pec 1"])


async def focus(b: Bridge) -> bool:
    before = b.sim.focuser.position(b.sim.clock()) if hasattr(b.sim, "focuser") else 0
    await b.controller.perform(op.Focus(1, 4))
    await asyncio.sleep(2.0)
    inward = (
        b.sim.accessories.get("focuser") if hasattr(b.sim, "accessories") else b.sim.focuser.is_moving(b.sim.clock())
    )
    await b.controller.perform(op.Focus(0))
    if hasattr(b.sim, "accessories"):
        return inward == 1 and b.sim.accessories["focuser"] == 0 and b.sim.accessories["focus speed"] == 4
    if b.sim.focuser.position(b.sim.clock()) > before:
        return False  # it counts outward
    return inward and not b.sim.focuser.is_moving(b.sim.clock()) and b.sim.focuser.position(b.sim.clock()) != before


#: The order on one mount: operations that put it out of service come last.
CHECKS: dict[type[op.Operation], Check] = {
    op.GetIdentity: identity, op.GetStatus: status, op.Position: position, op.HorizontalPosition: horizon,
    op.AxisPosition: axis_position, op.Slewing: slewing, op.GetSite: site, op.GetClock: clock, op.GetGps: gps,
    op.SiderealTime: sidereal, op.PierSide: pier_side, op.GuideRate: guide_rate, op.Goto: goto, op.Sync: sync,
    op.Move: move, op.StopAxis: halt, op.MoveAxis: move_axis, op.Pulse: pulse, op.PulseAxis: pulse_axis,
    op.AbortMotion: stop, op.AbortSlew: cancel_goto, op.GotoHorizontal: goto_horizontal, op.GotoAxes: goto_axes,
    op.DriveRate: drive_rate, op.SetTracking: set_tracking, op.TrackRate: track_rate,
    op.SetGuideRate: set_guide_rate, op.Backlash: backlash,
    op.PeriodicError: periodic_error, op.Focus: focus, op.ClockFromGps: clock_from_gps, op.HomeState: home_state,
    op.SetHome: set_home, op.Home: home, op.Park: park, op.Unpark: unpark, op.Hibernate: sleep, op.Wake: wake,
    op.SetSite: set_site, op.SetClock: set_clock,
}  # fmt: skip


async def outcomes(driven: str, model: str, version: str | None = None, **settings: Any) -> dict[str, str]:
    """Return operation name -> ``does``, ``nothing``, or the class name of the fault."""
    config = {"site_time": "always", "lowest": -90.0, "site": (45.0, 10.0)}
    bridge = Bridge(model, version, driven=driven, latency=0.005, config=config, speed=6.0, **settings)
    if hasattr(bridge.sim, "focuser"):
        bridge.sim.focuser = FocuserMotor()
    found = {}
    async with bridge:
        for operation, check in CHECKS.items():
            try:
                found[operation.__name__] = "does" if await check(bridge) else "nothing"
            except Fault as fault:
                found[operation.__name__] = type(fault).__name__ if str(fault) != "nothing" else "nothing"
    return found
