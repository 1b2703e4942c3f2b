"""Checks of ASCOM's judge on connecting, on what can be done, and on every property: its type, range and writing."""

from __future__ import annotations

import asyncio
import math
import re
from datetime import datetime, timedelta
from functools import partial
from typing import Any

from tests.conformance.ascom.telescope import (
    INVALID,
    NOT_IMPLEMENTED,
    NOT_SET,
    Ascom,
    Check,
    Issue,
    Skipped,
    Telescope,
    must,
)

#: What a mount says it can do; each is checked with its method, too.
CAN = [
    "FindHome", "Park", "PulseGuide", "SetDeclinationRate", "SetGuideRates", "SetPark", "SetPierSide",
    "SetRightAscensionRate", "SetTracking", "Slew", "SlewAltAz", "SlewAltAzAsync", "SlewAsync", "Sync", "SyncAltAz",
    "Unpark",
]  # fmt: skip
_UTC = re.compile(r"\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}(\.\d+)?Z")


# --- connecting ------------------------------------------------------------------------------------------------------


async def before_connecting(scope: Telescope) -> None:
    must(await scope.get("InterfaceVersion") == 4, "not version 4")
    must(await scope.get("Connecting") is False, "Connecting is true")
    must(await scope.get("Connected") is False, "Connected is true")


async def connected_written(scope: Telescope) -> None:
    for on in (True, False):
        await scope.write("Connected", on)
        must(await scope.get("Connected") is on, f"Connected is not {on}")
        await asyncio.sleep(0.5)


async def connect(scope: Telescope) -> None:
    await scope.put("Connect")
    await scope.while_true("Connecting", 10.0)
    must(await scope.get("Connected") is True, "not connected")
    for name in CAN:
        scope.can[name] = await scope.get(f"Can{name}")


async def disconnect(scope: Telescope) -> None:
    await scope.put("Disconnect")
    await scope.while_true("Connecting", 10.0)
    must(await scope.get("Connected") is False, "still connected")


async def can(scope: Telescope, name: str) -> None:
    must(type(await scope.get(name)) is bool, "no truth value")


async def unpark_needs_park(scope: Telescope) -> None:
    must(scope.can["Park"] or not scope.can["Unpark"], "CanUnpark without CanPark")


async def device_state(scope: Telescope) -> None:
    names = {one["Name"] for one in await scope.get("DeviceState")}
    expected = {
        "Altitude", "AtHome", "AtPark", "Azimuth", "Declination", "IsPulseGuiding", "RightAscension", "SideOfPier",
        "SiderealTime", "Slewing", "Tracking", "UTCDate", "TimeStamp",
    }  # fmt: skip
    must(names == expected, f"differs in {names ^ expected}")


# --- reading ---------------------------------------------------------------------------------------------------------


async def reads(scope: Telescope, member: str, kind: type, low: float = -math.inf, high: float = math.inf) -> None:
    value = await scope.get(member)
    must(type(value) is kind, f"{value!r} is no {kind.__name__}")
    must(kind in (str, list) or low <= value <= high, f"{value} is not from {low} to {high}")
    must(kind not in (str, list) or bool(value), "it is empty")


async def may_read(scope: Telescope, member: str) -> None:
    """An optional member: a number, or not implemented."""
    try:
        must(await scope.get(member) >= 0, "it is negative")
    except Ascom as error:
        must(error.number == NOT_IMPLEMENTED, str(error))


async def not_set(scope: Telescope, member: str) -> None:
    try:
        raise Issue(f"{await scope.get(member)} before it was set")
    except Ascom as error:
        must(error.number == NOT_SET, str(error))


async def sidereal_time(scope: Telescope) -> None:
    days = scope.own.clock() / 86400.0 - 10957.5
    expected = 18.697374558 + 24.065709824419081 * days + await scope.get("SiteLongitude") / 15.0
    told = await scope.get("SiderealTime")
    must(0.0 <= told < 24.0, f"{told} hours")
    must(abs((told - expected + 12.0) % 24.0 - 12.0) <= 1.0 / 60.0, f"{told} hours instead of {expected % 24.0}")


async def rate_read(scope: Telescope, member: str) -> None:
    must(await scope.get(member) == 0.0 or scope.can[f"Set{member}"], "not 0")


async def pulse_guiding(scope: Telescope) -> None:
    must(scope.can["PulseGuide"], "it is told without CanPulseGuide")
    must(await scope.get("IsPulseGuiding") is False, "it is true")


# --- writing ---------------------------------------------------------------------------------------------------------


async def cannot_be_written(scope: Telescope, member: str, value: Any) -> None:
    await scope.refuses(member, NOT_IMPLEMENTED, **{member: value})


async def guide_rate(scope: Telescope, member: str) -> None:
    rate = await scope.get(member)
    if scope.can["SetGuideRates"]:
        await scope.write(member, rate)
    else:
        await cannot_be_written(scope, member, rate)


async def settle_time(scope: Telescope) -> None:
    await scope.refuses("SlewSettleTime", INVALID, NOT_IMPLEMENTED, SlewSettleTime=-1)
    await scope.refuses("SlewSettleTime", NOT_IMPLEMENTED, SlewSettleTime=0)


async def out_of_range(scope: Telescope, member: str, values: tuple[float, float]) -> None:
    for value in values:
        await scope.refuses(member, INVALID, **{member: value})


async def written_and_read(scope: Telescope, member: str, step: float) -> None:
    """The value that it has, another one that is read again, and the first."""
    first = await scope.get(member)
    await scope.write(member, first)
    other = first + math.copysign(step, first)
    await scope.write(member, other)
    told = await scope.get(member)
    await scope.write(member, first)
    must(told == other, f"{other} was written, {told} is read")
    must(await scope.get(member) == first, "the first value is not restored")


async def tracking(scope: Telescope) -> None:
    first = await scope.get("Tracking")
    if not scope.can["SetTracking"]:
        await cannot_be_written(scope, "Tracking", not first)
        return
    for on in (not first, first):
        await scope.write("Tracking", on)
        await asyncio.sleep(1.0)
        must(await scope.get("Tracking") is on, f"it is not {on}")


async def tracking_rate(scope: Telescope) -> None:
    """Each of its rates is taken, and no other; offsets are only for sidereal."""
    first, rates = await scope.get("TrackingRate"), await scope.get("TrackingRates")
    must(first in rates, f"{first} is none of {rates}")
    for rate in rates:
        try:
            await scope.write("TrackingRate", rate)
        except Ascom as error:
            must(error.number == NOT_IMPLEMENTED and rates == [0], str(error))
            return
        must(await scope.get("TrackingRate") == rate, f"{rate} was written")
        for offset in ("DeclinationRate", "RightAscensionRate"):
            must(await scope.get(offset) == 0.0, f"{offset} is not 0 with rate {rate}")
    for rate in {0, 1, 2, 3, 5, -1} - set(rates):
        await scope.refuses("TrackingRate", INVALID, TrackingRate=rate)
    await scope.write("TrackingRate", first)


async def utc_date(scope: Telescope) -> None:
    told = await scope.get("UTCDate")
    must(_UTC.fullmatch(told) is not None, f"{told} has not ASCOM's form")
    must(abs(datetime.fromisoformat(told).timestamp() - scope.own.clock()) < 5.0, f"{told} is not the time")


async def utc_date_written(scope: Telescope) -> None:
    for hours in (1.0, 0.0):
        moment = datetime.fromisoformat(await scope.get("UTCDate")) + timedelta(hours=hours or -1.0)
        await scope.write("UTCDate", f"{moment:%Y-%m-%dT%H:%M:%S.%f}Z")
    await utc_date(scope)


async def side_of_pier_written(scope: Telescope) -> None:
    if scope.can["SetPierSide"]:
        raise Skipped
    await cannot_be_written(scope, "SideOfPier", 0)


CONNECTING: dict[str, Check] = {
    "Before connecting": before_connecting, "Connected": connected_written, "Connect": connect,
}  # fmt: skip
PROPERTIES: dict[str, Check] = {
    "TargetDeclination before it is set": partial(not_set, member="TargetDeclination"),
    "TargetRightAscension before it is set": partial(not_set, member="TargetRightAscension"),
    "Description": partial(reads, member="Description", kind=str),
    "DriverInfo": partial(reads, member="DriverInfo", kind=str),
    "DriverVersion": partial(reads, member="DriverVersion", kind=str),
    "Name": partial(reads, member="Name", kind=str),
    "SupportedActions": partial(reads, member="SupportedActions", kind=list),
    "DeviceState": device_state,
    **{f"Can{name}": partial(can, name=f"Can{name}") for name in CAN},
    "CanUnpark with CanPark": unpark_needs_park,
    "AlignmentMode": partial(reads, member="AlignmentMode", kind=int, low=0, high=2),
    "Altitude": partial(reads, member="Altitude", kind=float, low=0.0, high=90.0),
    "ApertureArea": partial(may_read, member="ApertureArea"),
    "ApertureDiameter": partial(may_read, member="ApertureDiameter"),
    "AtHome": partial(reads, member="AtHome", kind=bool),
    "AtPark": partial(reads, member="AtPark", kind=bool, high=0),
    "Azimuth": partial(reads, member="Azimuth", kind=float, low=0.0, high=360.0),
    "Declination": partial(reads, member="Declination", kind=float, low=-90.0, high=90.0),
    "DeclinationRate": partial(rate_read, member="DeclinationRate"),
    "DeclinationRate written": partial(cannot_be_written, member="DeclinationRate", value=0.0),
    "DoesRefraction": partial(may_read, member="DoesRefraction"),
    "DoesRefraction written": partial(cannot_be_written, member="DoesRefraction", value=True),
    "EquatorialSystem": partial(reads, member="EquatorialSystem", kind=int, low=0, high=4),
    "FocalLength": partial(may_read, member="FocalLength"),
    "GuideRateDeclination": partial(guide_rate, member="GuideRateDeclination"),
    "GuideRateRightAscension": partial(guide_rate, member="GuideRateRightAscension"),
    "IsPulseGuiding": pulse_guiding,
    "RightAscension": partial(reads, member="RightAscension", kind=float, low=0.0, high=23.99999),
    "RightAscensionRate": partial(rate_read, member="RightAscensionRate"),
    "RightAscensionRate written": partial(cannot_be_written, member="RightAscensionRate", value=0.0),
    "SiteElevation": partial(reads, member="SiteElevation", kind=float, low=-300.0, high=10000.0),
    "SiteElevation out of range": partial(out_of_range, member="SiteElevation", values=(-301.0, 10001.0)),
    "SiteElevation written": partial(written_and_read, member="SiteElevation", step=2385.0),
    "SiteLatitude": partial(reads, member="SiteLatitude", kind=float, low=-90.0, high=90.0),
    "SiteLatitude out of range": partial(out_of_range, member="SiteLatitude", values=(-91.0, 91.0)),
    "SiteLatitude written": partial(written_and_read, member="SiteLatitude", step=10.0),
    "SiteLongitude": partial(reads, member="SiteLongitude", kind=float, low=-180.0, high=180.0),
    "SiteLongitude out of range": partial(out_of_range, member="SiteLongitude", values=(-181.0, 181.0)),
    "SiteLongitude written": partial(written_and_read, member="SiteLongitude", step=10.0),
    "Slewing": partial(reads, member="Slewing", kind=bool, high=0),
    "SlewSettleTime": partial(may_read, member="SlewSettleTime"),
    "SlewSettleTime written": settle_time,
    "SideOfPier": partial(reads, member="SideOfPier", kind=int, low=-1, high=1),
    "SideOfPier written": side_of_pier_written,
    "SiderealTime": sidereal_time,
    "Tracking": partial(reads, member="Tracking", kind=bool),
    "Tracking written": tracking,
    "TrackingRates": partial(reads, member="TrackingRates", kind=list),
    "TrackingRate": tracking_rate,
    "UTCDate": utc_date,
    "UTCDate written": utc_date_written,
}  # fmt: skip
