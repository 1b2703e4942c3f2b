"""Where the tube pointed over the horizon, and whether it was day: the recording's places, seen from the site."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation
from gateway.diagnostics.report.night import Night

#: Faster than this (degrees a second) it is on its way somewhere; a gap of more seconds than that breaks the line.
FAST, GAP = 0.05, 120.0
#: Seconds between two looks at the Sun, and looks at most.
LOOK, LOOKS = 240.0, 400
#: Sun altitudes that end the day, and the twilight.
SET, DARK = -0.8, -18.0


class Seen(NamedTuple):
    """A place over the horizon. ``slewing`` tells that it was fast on its way there, ``joined`` that it came from the
    one before."""

    time: float
    alt: float
    az: float
    slewing: bool
    joined: bool


def track(night: Night, sky: Sky) -> list[Seen]:
    """Nothing where no site is known."""
    if night.site is None:
        return []
    latitude, longitude, _ = night.site
    found: list[Seen] = []
    for time, ra, dec in night.pointings:
        if night.equinox == "j2000":
            ra, dec = sky.to_of_date(ra, dec, time)
        az, alt = sky.horizon(ra, dec, latitude, longitude, time)
        joined = bool(found) and time - found[-1].time <= GAP
        slewing = joined and separation(az, alt, found[-1].az, found[-1].alt) > FAST * (time - found[-1].time)
        found.append(Seen(time, alt, az, slewing, joined))
    return found


def pieces(seen: list[Seen]) -> Iterator[list[Seen]]:
    """Stretches of one kind, each beginning with the end of the one before it."""
    piece: list[Seen] = []
    for place in seen:
        if piece and (not place.joined or (len(piece) > 1 and place.slewing != piece[-1].slewing)):
            yield piece
            piece = [piece[-1]] if place.joined else []
        piece.append(place)
    if piece:
        yield piece


class Light(NamedTuple):
    """A part of the time: ``day``, ``twilight`` or ``dark``."""

    began: float
    ended: float
    kind: str


def light(night: Night, sky: Sky) -> list[Light]:
    """The whole time in parts; nothing where no site is known."""
    if night.site is None or night.ended <= night.began:
        return []
    step = max(LOOK, (night.ended - night.began) / LOOKS)
    found: list[Light] = []
    time = night.began
    while time < night.ended:
        end, kind = min(time + step, night.ended), _kind(night, sky, time)
        if found and found[-1].kind == kind:
            found[-1] = found[-1]._replace(ended=end)
        else:
            found.append(Light(time, end, kind))
        time = end
    return found


def _kind(night: Night, sky: Sky, time: float) -> str:
    assert night.site is not None
    _, alt = sky.horizon(*sky.sun(time), night.site.latitude, night.site.longitude, time)
    return "day" if alt > SET else "twilight" if alt > DARK else "dark"
