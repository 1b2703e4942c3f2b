"""Describe operations in users' words, as in ``go to RA 05:34:32, Dec +22°00'52", and track there``."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from gateway.core import operations as op
from gateway.core.operations import Operation
from gateway.diagnostics.log.words import FORMS

#: The names that hand controls have for speeds.
_RATES = {"guide": "guiding speed", "center": "centring speed", "find": "finding speed", "max": "full speed"}
_MODES = {
    "off": "off",
    "alt-az": "in alt-az",
    "eq-north": "equatorially, in the north",
    "eq-south": "equatorially, in the south",
}


def meaning(operation: Operation) -> str:
    """Describe an operation with all its values."""
    told = _WORDS.get(type(operation), _by_name)
    return told if isinstance(told, str) else told(operation)


def _by_name(operation: Operation) -> str:
    """Describe an operation that has no description of its own by its name and values."""
    name = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(operation).__name__).lower()
    values = [
        f"{field.replace('_', ' ')} {_value(value)}"
        for field in operation.__struct_fields__
        if (value := getattr(operation, field)) not in (None, ())
    ]
    return f"{name}: {', '.join(values)}" if values else name


def _value(value: object) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, tuple):
        return " ".join(_value(part) for part in value)
    return str(getattr(value, "value", value))


def _place(one: Any) -> str:
    return f"RA {FORMS['hours'](one.ra)}, Dec {FORMS['signed'](one.dec)}"


def _horizon(one: Any) -> str:
    return f"azimuth {FORMS['turn'](one.az)}, altitude {FORMS['signed'](one.alt)}"


def _axis(number: int | None) -> str:
    return {1: "the first axis (right ascension or azimuth)", 2: "the second axis (declination or altitude)"}.get(
        number or 0, "both axes"
    )


def _rate(rate: op.Rate) -> str:
    parts = []
    if rate.name is not None:
        parts.append(f"at {_RATES.get(rate.name, rate.name)}")
    if rate.key is not None:
        parts.append(f"with speed {rate.key} of the hand control")
    if rate.degrees is not None:
        parts.append(f"{'no faster than' if parts else 'at'} {rate.degrees:g}° a second")
    return ", ".join(parts)


def _limits(one: Any) -> str:
    low = "" if one.lowest is None else f", no lower than {one.lowest:g}°"
    return low + ("" if one.highest is None else f", no higher than {one.highest:g}°")


def _site(one: op.SetSite) -> str:
    if one.latitude is None and one.longitude is None:
        return "the mount stands where its own hand control says" if one.others is not None else "the mount's site"
    parts = [
        None if one.latitude is None else f"latitude {FORMS['north'](one.latitude)}",
        None if one.longitude is None else f"longitude {FORMS['east'](one.longitude)}",
    ]
    return f"the mount stands at {', '.join(part for part in parts if part)}"


def _clock(one: op.SetClock) -> str:
    from datetime import UTC, datetime

    saving = "" if one.dst is None else ", daylight saving" if one.dst else ", no daylight saving"
    return f"it is {datetime.fromtimestamp(one.unix, UTC):%Y-%m-%d %H:%M:%S} UTC, UTC{one.offset:+g} h here{saving}"


def _moon(one: op.MoonPlace) -> str:
    if one.latitude is None or one.longitude is None:
        return "where is the middle of the Moon now?"
    return f"where is {FORMS['north'](one.latitude)}, {FORMS['east'](one.longitude)} on the Moon now?"


def _sense(sense: int) -> str:
    return "forwards" if sense > 0 else "backwards"


_WORDS: dict[type[Operation], str | Callable[[Any], str]] = {
    # queries, and operations without values
    op.Position: "where does the mount point (right ascension and declination)?",
    op.HorizontalPosition: "where does the mount point (azimuth and altitude)?",
    op.AxisPosition: "where do the two motor axes stand?",
    op.Slewing: "is a goto under way?",
    op.GetStatus: "does the mount track, and is it aligned?",
    op.GetIdentity: "which mount is it?",
    op.GetSite: "where does the mount stand?",
    op.GetClock: "what is the mount's time?",
    op.GetGps: "what does the mount's GPS receiver tell?",
    op.SiderealTime: "what is the sidereal time?",
    op.PierSide: "on which side of the pier is the tube?",
    op.DriveRate: "at which rate does it track?",
    op.Zenith: "what stands in the zenith now?",
    op.HomeState: "has the mount found its home position?",
    op.AbortMotion: "stop every motion; tracking stays as it is",
    op.AbortSlew: "end the goto",
    op.Park: "go to the park position, and switch tracking off there",
    op.Home: "go to the home position",
    op.SetHome: "the present position is home from now on",
    op.Unpark: "take up service again, tracking",
    op.Hibernate: "go to sleep",
    op.Wake: "wake up",
    op.ClockFromGps: "set the mount's clock by its GPS receiver",
    op.Choose: "look for an object in the mount's own library",
    op.Goto: lambda one: f"go to {_place(one)}" + (", and track there" if one.track else "") + _limits(one),
    op.GotoHorizontal: lambda one: f"go to {_horizon(one)}{_limits(one)}",
    op.GotoAxes: lambda one: f"turn the motors to {one.az:g}° and {one.alt:g}°",
    op.Sync: lambda one: f"the mount points at {_place(one)} now",
    op.Move: lambda one: f"move {one.direction.word} {_rate(one.rate)}, until it is stopped{_limits(one)}",
    op.MoveAxis: lambda one: f"turn {_axis(one.axis)} {_sense(one.sense)} {_rate(one.rate)}, until it is stopped",
    op.StopAxis: lambda one: f"stop {_axis(one.axis)}",
    op.Pulse: lambda one: f"guide {one.direction.word} for {one.ms} ms",
    op.PulseAxis: lambda one: f"guide with {_axis(one.axis)} {_sense(one.sense)} for {one.ms} ms"
                              + ("" if one.rate is None else f" at {one.rate:g} of the sidereal rate"),
    op.SetTracking: lambda one: "tracking off" if not one.on else
                                "tracking on" + (f" {_MODES[one.mode.value]}" if one.mode else ""),
    op.TrackRate: lambda one: f"track at the {one.name} rate" if one.name else
                              f"track at {one.factor:g} of the sidereal rate",
    op.GuideRate: lambda one: f"how fast does {_axis(one.axis)} guide?",
    op.SetGuideRate: lambda one: f"guide with {_axis(one.axis)} at {one.rate:g} of the sidereal rate",
    op.Backlash: lambda one: f"take {one.value} of 99 for the backlash of {_axis(one.axis)}",
    op.PeriodicError: lambda one: f"periodic error correction of {_axis(one.axis)} " + (
        "the other way round" if one.on is None else "on" if one.on else "off"),
    op.Focus: lambda one: "stop the focuser" if not one.direction else
                          f"move the focuser {'in' if one.direction > 0 else 'out'}, speed {one.speed}",
    op.SetSite: _site,
    op.SetClock: _clock,
    op.SetZone: lambda one: f"this program reads the time in the zone UTC{one.offset:+g} h",
    op.ToEquinoxOfDate: lambda one: f"where is J2000 {_place(one)} today?",
    op.ToJ2000: lambda one: f"where is {_place(one)} of today by J2000?",
    op.PlanetPlace: lambda one: f"where is {one.name} now?",
    op.MoonPlace: _moon,
    op.PassThrough: lambda one: f"hand {one.command} to the mount as it is",
    op.Own: lambda one: f"what does the mount itself answer to {one.command}?",
}  # fmt: skip
