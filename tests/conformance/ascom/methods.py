"""Checks of ASCOM's judge on every method: what moves arrives where it should, what cannot be is refused as defined."""

from __future__ import annotations

import asyncio
import itertools
from functools import partial
from typing import Any

from tests.conformance.ascom.gotos import (
    destination_side,
    side_of_pier,
    slew,
    slew_bad,
    slew_over_the_horizon,
    slew_over_the_horizon_bad,
    sync,
    sync_over_the_horizon,
    target,
)
from tests.conformance.ascom.telescope import (
    INVALID,
    NOT_IMPLEMENTED,
    PARKED,
    STOPPING,
    Ascom,
    Check,
    Telescope,
    must,
    needs,
)

PRIMARY, SECONDARY, TERTIARY = 0, 1, 2
NORTH, SOUTH, EAST, WEST = 0, 1, 2, 3
#: Seconds for which an axis is moved.
MOVED = 2.0
#: Seconds of the pulses that are measured, and arcseconds of their tolerance; the hour angles at which they are given.
PULSE, NEAR = 5.0, 1.0
HOURS = (-9.0, 3.0, 9.0, -3.0)
#: Arcseconds of right ascension in an hour.
HOUR = 54000.0
#: What is asked of a parked mount: the ability it needs, the method and its parameters.
WHILE_PARKED: dict[str, tuple[str, str, dict[str, Any]]] = {
    "AbortSlew": ("Slew", "AbortSlew", {}),
    "FindHome": ("FindHome", "FindHome", {}),
    "MoveAxis Primary": ("Slew", "MoveAxis", {"Axis": PRIMARY, "Rate": 0.0}),
    "MoveAxis Secondary": ("Slew", "MoveAxis", {"Axis": SECONDARY, "Rate": 0.0}),
    "PulseGuide": ("PulseGuide", "PulseGuide", {"Direction": EAST, "Duration": 0}),
    "SlewToCoordinates": ("Slew", "SlewToCoordinates", {"RightAscension": 1.0, "Declination": 0.0}),
    "SlewToCoordinatesAsync": ("SlewAsync", "SlewToCoordinatesAsync", {"RightAscension": 1.0, "Declination": 0.0}),
    "SlewToTarget": ("Slew", "SlewToTarget", {}),
    "SlewToTargetAsync": ("SlewAsync", "SlewToTargetAsync", {}),
    "SlewToAltAz": ("SlewAltAz", "SlewToAltAz", {"Azimuth": 150.0, "Altitude": 50.0}),
    "SlewToAltAzAsync": ("SlewAltAz", "SlewToAltAzAsync", {"Azimuth": 150.0, "Altitude": 50.0}),
    "SyncToCoordinates": ("Sync", "SyncToCoordinates", {"RightAscension": 1.0, "Declination": 0.0}),
    "SyncToTarget": ("Sync", "SyncToTarget", {}),
    "Tracking": ("SetTracking", "Tracking", {"Tracking": True}),
}


# --- park, home, abort -----------------------------------------------------------------------------------------------


async def slew_after_the_clock(scope: Telescope) -> None:
    """The judge goes on to methods right after it has written UTCDate. What a refusal is due to is over in a while."""
    try:
        await scope.slew_to_hour_angle(-3.0)
    except Ascom:
        await asyncio.sleep(15.0)
        raise


async def park(scope: Telescope) -> None:
    if not scope.can["Park"]:
        await scope.refuses("Park", NOT_IMPLEMENTED)
        return
    await scope.slew_to_hour_angle(-3.0)
    for _ in range(2):  # parking twice does no harm
        await scope.put("Park")
        await scope.stands()
        must(await scope.get("AtPark") is True, "not parked when Slewing is false")


async def while_parked(scope: Telescope, ability: str, member: str, parameters: dict[str, Any]) -> None:
    needs(scope, "Park")
    needs(scope, ability)
    if member.endswith(("Target", "TargetAsync")):
        await scope.write("TargetRightAscension", await scope.at_hour_angle(-1.0))
        await scope.write("TargetDeclination", 0.0)
    await scope.refuses(member, PARKED, **parameters)
    must(await scope.get("AtPark") is True and await scope.get("Slewing") is False, "no longer parked")


async def tracking_off_parked(scope: Telescope) -> None:
    needs(scope, "Park")
    await scope.tracks(False)
    must(await scope.get("Tracking") is False, "it tracks")


async def unpark(scope: Telescope) -> None:
    if not scope.can["Unpark"]:
        await scope.refuses("Unpark", NOT_IMPLEMENTED)
        return
    for _ in range(2):
        await scope.put("Unpark")
        await scope.stands()
        must(await scope.get("AtPark") is False, "still parked")
        await scope.tracks()


async def find_home(scope: Telescope) -> None:
    if not scope.can["FindHome"]:
        await scope.refuses("FindHome", NOT_IMPLEMENTED)
        return
    await scope.tracks(False)
    await scope.put("FindHome")
    await scope.stands()
    must(await scope.get("AtHome") is True, "AtHome is false")
    must(await scope.get("AtPark") is False, "it is parked")
    await scope.tracks()


async def abort(scope: Telescope) -> None:
    await scope.put("AbortSlew")
    await scope.tracks()
    place = {"RightAscension": await scope.at_hour_angle(-3.0), "Declination": await scope.high(-3.0)}
    await scope.put("SlewToCoordinatesAsync", **place)
    await asyncio.sleep(1.5)
    must(await scope.get("Slewing") is True, "Slewing is false 1.5 s after the request")
    await scope.put("AbortSlew")
    await scope.stands(STOPPING)


# --- by hand ---------------------------------------------------------------------------------------------------------


async def can_move_axis(scope: Telescope, axis: int) -> None:
    must(type(await scope.get("CanMoveAxis", Axis=axis)) is bool, "no truth value")


async def axis_rates(scope: Telescope, axis: int) -> None:
    rates = sorted((one["Minimum"], one["Maximum"]) for one in await scope.get("AxisRates", Axis=axis))
    must(bool(rates) is await scope.get("CanMoveAxis", Axis=axis), "differs from CanMoveAxis")
    must(all(0.0 < low <= high for low, high in rates), f"no rates: {rates}")
    must(all(one[1] < two[0] for one, two in itertools.pairwise(rates)), f"they overlap: {rates}")


async def _rates(scope: Telescope, axis: int) -> tuple[float, float]:
    rates = await scope.get("AxisRates", Axis=axis)
    return min(one["Minimum"] for one in rates), max(one["Maximum"] for one in rates)


async def _moved(scope: Telescope, axis: int, rate: float) -> None:
    await scope.put("MoveAxis", Axis=axis, Rate=rate)
    must(await scope.get("Slewing") is True, f"Slewing is false while it moves at {rate}")
    await asyncio.sleep(MOVED)
    await scope.put("MoveAxis", Axis=axis, Rate=0.0)
    await scope.stands(STOPPING)


async def move_axis_refused(scope: Telescope, axis: int) -> None:
    """At no rate it moves; a rate below the lowest one or above the highest is refused."""
    if not await scope.get("CanMoveAxis", Axis=axis):
        await scope.refuses("MoveAxis", NOT_IMPLEMENTED, Axis=axis, Rate=1.0)
        return
    await scope.put("MoveAxis", Axis=axis, Rate=0.0)
    await scope.stands(STOPPING)
    low, high = await _rates(scope, axis)
    for rate in (low / 2.0, high + 1.0, -low / 2.0, -high - 1.0):
        await scope.refuses("MoveAxis", INVALID, Axis=axis, Rate=rate)


async def move_axis(scope: Telescope, axis: int, sign: float) -> None:
    for rate in await _rates(scope, axis):
        await _moved(scope, axis, sign * rate)


async def move_axis_keeps_tracking(scope: Telescope, axis: int) -> None:
    _, high = await _rates(scope, axis)
    for sign in (1.0, -1.0):
        if scope.can["SetTracking"]:
            await scope.write("Tracking", sign > 0.0)
        first = await scope.get("Tracking")
        await _moved(scope, axis, sign * high)
        must(await scope.get("Tracking") is first, f"it was {first}")
    await scope.tracks()


async def pulses(scope: Telescope) -> None:
    """A pulse is told as long as it lasts; two axes at once."""
    if not scope.can["PulseGuide"]:
        await scope.refuses("PulseGuide", NOT_IMPLEMENTED, Direction=EAST, Duration=2000)
        return
    await scope.slew_to_hour_angle(-3.0)
    for directions in ((EAST,), (NORTH,), (EAST, NORTH)):
        for direction in directions:
            await scope.put("PulseGuide", Direction=direction, Duration=2000)
            must(await scope.get("IsPulseGuiding") is True, "IsPulseGuiding is false during a pulse")
        await scope.while_true("IsPulseGuiding", 6.0)


async def pulse(scope: Telescope, member: str, directions: tuple[int, int]) -> None:
    """At four hour angles the position changes by the guide rate, forward and back, on this axis alone."""
    needs(scope, "PulseGuide")
    far, wrong = await scope.get(member) * 3600.0 * PULSE, []
    for hours in HOURS:
        await scope.slew_to_hour_angle(hours)
        for direction, expected in zip(directions, (far, -far), strict=True):
            before = await scope.get("RightAscension"), await scope.get("Declination")
            await scope.put("PulseGuide", Direction=direction, Duration=int(PULSE * 1000))
            await scope.while_true("IsPulseGuiding", PULSE + 5.0)
            east = (await scope.get("RightAscension") - before[0]) * HOUR
            north = (await scope.get("Declination") - before[1]) * 3600.0
            along, across = (north, east) if NORTH in directions else (east, north)
            if abs(along - expected) > NEAR or abs(across) > NEAR:
                wrong.append(f"{hours:+g} h: {along:.1f} instead of {expected:.1f}, {across:.1f} across")
    must(not wrong, f"arcseconds at {'; '.join(wrong)}")


# --- at the end ------------------------------------------------------------------------------------------------------


async def performance(scope: Telescope, member: str) -> None:
    for _ in range(20):
        await scope.get(member)


async def in_time(scope: Telescope) -> None:
    must(not scope.late, ", ".join(f"{member} {seconds:.1f} s" for member, seconds in scope.late.items()))


async def safe_at_the_end(scope: Telescope) -> None:
    await scope.tracks(False)


AXES = {"Primary": PRIMARY, "Secondary": SECONDARY}
METHODS: dict[str, Check] = {
    **{f"CanMoveAxis {axis}": partial(can_move_axis, axis=axis) for axis in range(3)},
    "A slew right after UTCDate": slew_after_the_clock,
    "Park": park,
    **{
        f"Parked: {name}": partial(while_parked, ability=ability, member=member, parameters=parameters)
        for name, (ability, member, parameters) in WHILE_PARKED.items()
    },
    "Parked: Tracking off": tracking_off_parked,
    "Unpark": unpark,
    "AbortSlew": abort,
    **{f"AxisRates {axis}": partial(axis_rates, axis=axis) for axis in range(3)},
    "FindHome": find_home,
    **{f"MoveAxis {axis} refused": partial(move_axis_refused, axis=axis) for axis in range(3)},
    **{f"MoveAxis {name}": partial(move_axis, axis=axis, sign=1.0) for name, axis in AXES.items()},
    **{f"MoveAxis {name} back": partial(move_axis, axis=axis, sign=-1.0) for name, axis in AXES.items()},
    **{f"MoveAxis {name} keeps tracking": partial(move_axis_keeps_tracking, axis=axis) for name, axis in AXES.items()},
    "PulseGuide": pulses,
    "PulseGuide north and south": partial(pulse, member="GuideRateDeclination", directions=(NORTH, SOUTH)),
    "PulseGuide east and west": partial(pulse, member="GuideRateRightAscension", directions=(EAST, WEST)),
    "SlewToCoordinates": partial(slew, method="SlewToCoordinates", hours=1.0),
    "SlewToCoordinates out of range": partial(slew_bad, method="SlewToCoordinates"),
    "SlewToCoordinatesAsync": partial(slew, method="SlewToCoordinatesAsync", hours=2.0),
    "SlewToCoordinatesAsync out of range": partial(slew_bad, method="SlewToCoordinatesAsync"),
    "SyncToCoordinates": partial(sync, method="SyncToCoordinates"),
    "SyncToCoordinates out of range": partial(slew_bad, method="SyncToCoordinates"),
    "TargetRightAscension": partial(target, member="TargetRightAscension", low=-1.0, high=25.0, good=4.5),
    "TargetDeclination": partial(target, member="TargetDeclination", low=-91.0, high=91.0, good=1.0),
    "SlewToTarget": partial(slew, method="SlewToTarget", hours=3.0),
    "SlewToTargetAsync": partial(slew, method="SlewToTargetAsync", hours=4.0),
    "DestinationSideOfPier": destination_side,
    "SlewToAltAz": partial(slew_over_the_horizon, method="SlewToAltAz", az=150.0, alt=50.0),
    "SlewToAltAz out of range": partial(slew_over_the_horizon_bad, method="SlewToAltAz"),
    "SlewToAltAzAsync": partial(slew_over_the_horizon, method="SlewToAltAzAsync", az=155.0, alt=55.0),
    "SlewToAltAzAsync out of range": partial(slew_over_the_horizon_bad, method="SlewToAltAzAsync"),
    "SyncToTarget": partial(sync, method="SyncToTarget"),
    "SyncToAltAz": sync_over_the_horizon,
    "SideOfPier at four hour angles": side_of_pier,
    **{
        f"Performance: {name}": partial(performance, member=name)
        for name in (
            "Altitude", "AtHome", "AtPark", "Azimuth", "Declination", "IsPulseGuiding", "RightAscension", "SideOfPier",
            "SiderealTime", "Slewing", "UTCDate",
        )
    },
    "Answers in time": in_time,
    "Tracking off at the end": safe_at_the_end,
}  # fmt: skip
