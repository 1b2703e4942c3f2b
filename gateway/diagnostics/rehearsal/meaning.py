"""Describe operations in users' words, as in ``go to RA 05:34:32, Dec +22°00'52", and track there``."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from gateway.core import operations as op
from gateway.core.operations import Operation
from gateway.diagnostics.log.words import FORMATS

#: The names of the speeds, by the names that the protocols use.
_RATE_NAMES = {"guide": "guiding speed", "center": "centring speed", "find": "finding speed", "max": "full speed"}
_TRACKING_NAMES = {
    "off": "off",
    "alt-az": "in alt-az",
    "eq-north": "equatorially, in the north",
    "eq-south": "equatorially, in the south",
}


def meaning(operation: Operation) -> str:
    """Describe an operation with all its values."""
    describe = _DESCRIBERS.get(type(operation), _describe_by_name)
    return describe if isinstance(describe, str) else describe(operation)


def _describe_by_name(operation: Operation) -> str:
    """Describe an operation that is not in `_DESCRIBERS`, by its name and values."""
    name = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(operation).__name__).lower()
    values = [
        f"{field.replace('_', ' ')} {_format_value(value)}"
        for field in operation.__struct_fields__
        if (value := getattr(operation, field)) not in (None, ())
    ]
    return f"{name}: {', '.join(values)}" if values else name


def _format_value(value: object) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, tuple):
        return " ".join(_format_value(part) for part in value)
    return str(getattr(value, "value", value))


def _ra_dec(position: Any) -> str:
    return f"RA {FORMATS['hours'](position.ra)}, Dec {FORMATS['signed'](position.dec)}"


def _format_az_alt(position: Any) -> str:
    return f"azimuth {FORMATS['turn'](position.az)}, altitude {FORMATS['signed'](position.alt)}"


def _axis_name(number: int | None) -> str:
    return {1: "the first axis (right ascension or azimuth)", 2: "the second axis (declination or altitude)"}.get(
        number or 0, "both axes"
    )


def _rate(rate: op.Rate) -> str:
    parts = []
    if rate.name is not None:
        parts.append(f"at {_RATE_NAMES.get(rate.name, rate.name)}")
    if rate.key is not None:
        parts.append(f"with speed {rate.key} of the hand control")
    if rate.degrees is not None:
        parts.append(f"{'no faster than' if parts else 'at'} {rate.degrees:g}° a second")
    return ", ".join(parts)


def _limits(operation: Any) -> str:
    low = "" if operation.lowest is None else f", no lower than {operation.lowest:g}°"
    return low + ("" if operation.highest is None else f", no higher than {operation.highest:g}°")


def _describe_site(operation: op.SetSite) -> str:
    if operation.latitude is None and operation.longitude is None:
        return "the site is the one of the hand control" if operation.others is not None else "the mount's site"
    parts = [
        None if operation.latitude is None else f"latitude {FORMATS['north'](operation.latitude)}",
        None if operation.longitude is None else f"longitude {FORMATS['east'](operation.longitude)}",
    ]
    return f"the mount stands at {', '.join(part for part in parts if part)}"


def _describe_clock(operation: op.SetClock) -> str:
    from datetime import UTC, datetime

    saving = "" if operation.dst is None else ", daylight saving" if operation.dst else ", no daylight saving"
    time = datetime.fromtimestamp(operation.unix, UTC)
    return f"it is {time:%Y-%m-%d %H:%M:%S} UTC, UTC{operation.offset:+g} h here{saving}"


def _describe_moon_place(operation: op.MoonPlace) -> str:
    if operation.latitude is None or operation.longitude is None:
        return "where is the middle of the Moon now?"
    return f"where is {FORMATS['north'](operation.latitude)}, {FORMATS['east'](operation.longitude)} on the Moon now?"


def _turn_name(sense: int) -> str:
    return "forwards" if sense > 0 else "backwards"


_DESCRIBERS: dict[type[Operation], str | Callable[[Any], str]] = {
    # queries, and operations without values
    op.Position: "where does the mount point (right ascension and declination)?",
    op.HorizontalPosition: "where does the mount point (azimuth and altitude)?",
    op.AxisPosition: "where do the two motor axes stand?",
    op.Slewing: "is a goto under way?",
    op.GetStatus: "does the mount track, and is it aligned?",
    op.GetIdentity: "which mount is it?",
    op.GetSite: "what is the mount's site?",
    op.GetClock: "what is the mount's time?",
    op.GetGps: "what does the mount's GPS receiver report?",
    op.SiderealTime: "what is the sidereal time?",
    op.PierSide: "on which side of the pier is the tube?",
    op.DriveRate: "at which rate does it track?",
    op.Zenith: "what stands in the zenith now?",
    op.HomeState: "has the mount found its home position?",
    op.AbortMotion: "stop every motion; tracking stays as it is",
    op.AbortSlew: "end the goto",
    op.Park: "go to the park position, and switch tracking off there",
    op.Home: "go to the home position",
    op.SetHome: "the present position becomes home",
    op.Unpark: "unpark, and track",
    op.Hibernate: "go to sleep",
    op.Wake: "wake up",
    op.ClockFromGps: "set the mount's clock by its GPS receiver",
    op.Choose: "look for an object in the mount's own library",
    op.Goto: lambda order: f"go to {_ra_dec(order)}" + (", and track there" if order.track else "") + _limits(order),
    op.GotoHorizontal: lambda order: f"go to {_format_az_alt(order)}{_limits(order)}",
    op.GotoAxes: lambda order: f"turn the motors to {order.az:g}° and {order.alt:g}°",
    op.Sync: lambda order: f"the mount points at {_ra_dec(order)} now",
    op.Move: lambda order: f"move {order.direction.label} {_rate(order.rate)}, until it is stopped{_limits(order)}",
    op.MoveAxis: lambda order: (
        f"turn {_axis_name(order.axis)} {_turn_name(order.sense)} {_rate(order.rate)}, until it is stopped"),
    op.StopAxis: lambda order: f"stop {_axis_name(order.axis)}",
    op.Pulse: lambda order: f"guide {order.direction.label} for {order.ms} ms",
    op.PulseAxis: lambda order: f"guide with {_axis_name(order.axis)} {_turn_name(order.sense)} for {order.ms} ms"
                              + ("" if order.rate is None else f" at {order.rate:g} of the sidereal rate"),
    op.SetTracking: lambda order: "tracking off" if not order.on else
                                "tracking on" + (f" {_TRACKING_NAMES[order.mode.value]}" if order.mode else ""),
    op.TrackRate: lambda order: f"track at the {order.name} rate" if order.name else
                              f"track at {order.factor:g} of the sidereal rate",
    op.GuideRate: lambda order: f"how fast does {_axis_name(order.axis)} guide?",
    op.SetGuideRate: lambda order: f"guide with {_axis_name(order.axis)} at {order.rate:g} of the sidereal rate",
    op.Backlash: lambda order: f"take {order.value} of 99 for the backlash of {_axis_name(order.axis)}",
    op.PeriodicError: lambda order: f"periodic error correction of {_axis_name(order.axis)} " + (
        "the other way round" if order.on is None else "on" if order.on else "off"),
    op.Focus: lambda order: "stop the focuser" if not order.direction else
                          f"move the focuser {'in' if order.direction > 0 else 'out'}, speed {order.speed}",
    op.SetSite: _describe_site,
    op.SetClock: _describe_clock,
    op.SetZone: lambda order: f"this program reads the time in the zone UTC{order.offset:+g} h",
    op.ToEquinoxOfDate: lambda order: f"where is J2000 {_ra_dec(order)} today?",
    op.ToJ2000: lambda order: f"where is {_ra_dec(order)} of today by J2000?",
    op.PlanetPlace: lambda order: f"where is {order.name} now?",
    op.MoonPlace: _describe_moon_place,
    op.PassThrough: lambda order: f"hand {order.command} to the mount as it is",
    op.NativeRequest: lambda order: f"what does the mount itself answer to {order.command}?",
}  # fmt: skip
