"""Two plots of where the tube pointed: over the whole sky, and its altitude over the time."""

from __future__ import annotations

import math
from collections.abc import Iterable

from gateway.diagnostics.report.night import Night
from gateway.diagnostics.report.over_horizon import Light, Seen, pieces
from gateway.diagnostics.report.svg import Frame, Point, clock, path, picture, tag, text

SIDE, RADIUS = 460.0, 200.0
#: Pixels that a time needs beside a track.
WIDE, HIGH = 46.0, 15.0


def all_sky(seen: list[Seen], night: Night) -> str:
    """Stereographic, the zenith in the middle, north up, east to the left as one looks up."""
    middle = SIDE / 2
    drawn = [tag("circle", cx=middle, cy=middle, r=RADIUS, class_="sky")]
    for altitude in (30.0, 60.0):
        drawn.append(tag("circle", cx=middle, cy=middle, r=_reach(altitude), class_="grid"))
        drawn.append(text(f"{altitude:.0f}°", middle + 4, middle - _reach(altitude) - 3, "tick", "start"))
    for altitude in {night.lowest, night.highest} - {0.0, 90.0}:
        drawn.append(tag("circle", cx=middle, cy=middle, r=_reach(altitude), class_="limit"))
    drawn += [
        tag("line", x1=middle - RADIUS, x2=middle + RADIUS, y1=middle, y2=middle, class_="grid"),
        tag("line", x1=middle, x2=middle, y1=middle - RADIUS, y2=middle + RADIUS, class_="grid"),
    ]
    for azimuth, letter in ((0, "N"), (90, "E"), (180, "S"), (270, "W")):
        x, y = _point(azimuth, 0.0, RADIUS + 14)
        drawn.append(text(letter, x, y + 5, "compass"))
    for piece in pieces(seen):
        drawn.append(path((_point(place.az, place.alt) for place in piece), _kind(piece)))
    drawn += _times(seen)
    return picture(SIDE, SIDE, "".join(drawn), "Where the telescope pointed, over the whole sky")


def _reach(altitude: float) -> float:
    return RADIUS * math.tan(math.radians(90.0 - max(altitude, -5.0)) / 2)


def _point(azimuth: float, altitude: float, radius: float | None = None) -> Point:
    reach = _reach(altitude) if radius is None else radius
    turn = math.radians(azimuth)
    return SIDE / 2 - reach * math.sin(turn), SIDE / 2 - reach * math.cos(turn)


def _kind(piece: list[Seen]) -> str:
    return "slew" if piece[-1].slewing else "track"


def _times(seen: Iterable[Seen]) -> list[str]:
    """A dot and the time where it tracks or rests, wherever there is room for them."""
    drawn: list[str] = []
    taken: list[Point] = []
    for place in seen:
        x, y = _point(place.az, place.alt)
        if place.slewing or not place.joined or any(abs(x - a) < WIDE and abs(y - b) < HIGH for a, b in taken):
            continue
        drawn.append(tag("circle", cx=x, cy=y, r=3.5, class_="dot"))
        drawn.append(text(clock(place.time), x + 7, y + 4, "time", "start"))
        taken.append((x, y))
    return drawn


def altitude(seen: list[Seen], lights: list[Light], night: Night) -> str:
    """With day and twilight behind it, the limits, and what went wrong below."""
    frame = Frame(night.began, night.ended, 0.0, 90.0)
    drawn = [frame.band(part.began, part.ended, part.kind) for part in lights]
    drawn.append(frame.axes((value, f"{value}°") for value in (0, 30, 60, 90)))
    for limit in {night.lowest, night.highest} - {0.0, 90.0}:
        y = frame.y(limit)
        drawn.append(tag("line", x1=frame.x(night.began), x2=frame.x(night.ended), y1=y, y2=y, class_="limit"))
    for piece in pieces(seen):
        drawn.append(path(((frame.x(place.time), frame.y(place.alt)) for place in piece), _kind(piece)))
    for remark in night.refusals:
        x = frame.x(remark.time)
        drawn.append(path(((x, frame.foot), (x - 4, frame.foot + 7), (x + 4, frame.foot + 7)), "refusal", closed=True))
    return picture(frame.width, frame.height, "".join(drawn), "The telescope's altitude over the time")
