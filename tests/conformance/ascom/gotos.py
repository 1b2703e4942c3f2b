"""Checks of ASCOM's judge on gotos, syncs, targets and the side of the pier: by what the mount then reports."""

from __future__ import annotations

import math

from tests.conformance.ascom.telescope import INVALID, NOT_IMPLEMENTED, Skipped, Telescope, must, needs

EAST_OF_PIER, WEST_OF_PIER = 0, 1
GERMAN = 2
#: Degrees that a sync is told to be off, and how near a goto over the horizon must come.
OFF, HORIZON = 1.0, 2.0 / 60.0


# --- gotos and syncs -------------------------------------------------------------------------------------------------


async def aims_at(scope: Telescope, ra: float, dec: float) -> None:
    told = await scope.get("TargetRightAscension"), await scope.get("TargetDeclination")
    must(math.dist(told, (ra, dec)) < 1e-9, f"the target is {told}")


async def slew(scope: Telescope, method: str, hours: float) -> None:
    """To a place in its parameters, or to the target."""
    await scope.tracks()
    ra, dec = await scope.at_hour_angle(hours), hours
    if "Target" in method:
        await scope.write("TargetRightAscension", ra)
        await scope.write("TargetDeclination", dec)
        await scope.put(method)
    else:
        await scope.put(method, RightAscension=ra, Declination=dec)
    must(await scope.get("Slewing") is method.endswith("Async"), "Slewing is wrong when it is answered")
    await scope.stands()
    await scope.points_at(ra, dec, "after the slew")
    await aims_at(scope, ra, dec)


async def slew_bad(scope: Telescope, method: str) -> None:
    await scope.tracks()
    dec = await scope.get("Declination")
    for place in ((-1.0, dec), (25.0, dec), (5.0, -100.0), (5.0, 100.0)):
        await scope.refuses(method, INVALID, RightAscension=place[0], Declination=place[1])
    must(await scope.get("Slewing") is False, "it slews")


async def target(scope: Telescope, member: str, low: float, high: float, good: float) -> None:
    for value in (low, high):
        await scope.refuses(member, INVALID, **{member: value})
    await scope.write(member, good)
    must(abs(await scope.get(member) - good) < 1e-9, "it is not what was written")


async def slew_over_the_horizon(scope: Telescope, method: str, az: float, alt: float) -> None:
    await scope.tracks(False)
    place = {"Azimuth": az, "Altitude": alt}
    if not scope.can[method.replace("To", "")]:
        await scope.refuses(method, NOT_IMPLEMENTED, **place)
        return
    await scope.put(method, **place)
    must(await scope.get("Slewing") is method.endswith("Async"), "Slewing is wrong when it is answered")
    await scope.stands()
    far = abs(await scope.get("Azimuth") - az), abs(await scope.get("Altitude") - alt)
    must(max(far) <= HORIZON, f"{far} degrees away")
    must(await scope.get("Tracking") is False, "it tracks")


async def slew_over_the_horizon_bad(scope: Telescope, method: str) -> None:
    needs(scope, method.replace("To", ""))
    await scope.tracks(False)
    for az, alt in ((-10.0, 45.0), (370.0, 45.0), (150.0, -100.0), (150.0, 100.0)):
        await scope.refuses(method, INVALID, Azimuth=az, Altitude=alt)


async def sync(scope: Telescope, method: str) -> None:
    """A sync a degree aside, a goto there, the sync back, and a goto again."""
    if not scope.can["Sync"]:
        await scope.refuses(method, NOT_IMPLEMENTED, RightAscension=1.0, Declination=1.0)
        return
    north = await scope.get("SiteLatitude") >= 0.0
    ra, dec = await scope.at_hour_angle(3.0), (1.0 if north else -1.0) * 22.5
    await scope.slew(ra, dec)
    await scope.points_at(ra, dec, "after the slew")
    for side in (-1.0, 1.0):
        there = (ra + side * OFF / 15.0) % 24.0, dec + side * OFF
        if method == "SyncToTarget":
            await scope.write("TargetRightAscension", there[0])
            await scope.write("TargetDeclination", there[1])
            await scope.put(method)
        else:
            await scope.put(method, RightAscension=there[0], Declination=there[1])
            await aims_at(scope, *there)
        await scope.points_at(*there, "after the sync")
        await scope.slew(ra, dec)
        await scope.points_at(ra, dec, "after the slew that follows")


async def sync_over_the_horizon(scope: Telescope) -> None:
    await scope.tracks(False)
    await scope.refuses("SyncToAltAz", NOT_IMPLEMENTED, Azimuth=150.0, Altitude=50.0)
    await scope.tracks()


# --- German mounts ---------------------------------------------------------------------------------------------------


async def destination_side(scope: Telescope) -> None:
    if await scope.get("AlignmentMode") != GERMAN:
        raise Skipped
    await scope.slew_to_hour_angle(3.0)
    dec = math.copysign(45.0, await scope.get("SiteLatitude"))
    for hours, side in ((2.0, EAST_OF_PIER), (-2.0, WEST_OF_PIER)):
        ra = await scope.at_hour_angle(hours)
        told = await scope.get("DestinationSideOfPier", RightAscension=ra, Declination=dec)
        must(told == side, f"{told} at {hours:+g} h")


async def side_of_pier(scope: Telescope) -> None:
    """Told before each goto, and after it: how the mount points, also below the pole."""
    if await scope.get("AlignmentMode") != GERMAN:
        raise Skipped
    for hours in (-3.0, -9.0, 3.0, 9.0):
        await scope.slew_to_hour_angle(-3.0)
        ra, dec = await scope.at_hour_angle(hours), await scope.halfway(hours)
        side = WEST_OF_PIER if hours < 0.0 else EAST_OF_PIER
        told = await scope.get("DestinationSideOfPier", RightAscension=ra, Declination=dec)
        must(told == side, f"DestinationSideOfPier is {told} at {hours:+g} h")
        await scope.slew(ra, dec)
        must(await scope.get("SideOfPier") == side, f"not {side} at {hours:+g} h")
