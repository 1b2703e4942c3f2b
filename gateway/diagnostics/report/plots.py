"""The plots of a night: where the tube pointed, on an all-sky chart and over time, and how long replies took."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation
from gateway.diagnostics.report.night import Night
from gateway.diagnostics.report.svg import TOP, PlotFrame, Point, format_time_of_day, path, picture, tag, text

#: The number of intervals into which the night is divided.
INTERVAL_COUNT = 240
#: The vertical scale ends at this quantile of the reply times, multiplied by a margin.
SHOWN_QUANTILE, SCALE_MARGIN = 0.99, 1.3


class ReplyTimeSpread(NamedTuple):
    """The reply times of an interval, seconds: the 5 %, 50 % and 95 % quantile, the maximum; ``time``: its middle."""

    time: float
    quantile_05: float
    median: float
    quantile_95: float
    maximum: float


def quant(fraction: float, sorted_values: Sequence[float]) -> float:
    """Return a quantile (0 to 1) of sorted values."""
    return sorted_values[min(len(sorted_values) - 1, int(fraction * len(sorted_values)))]


def reply_time_spreads(night: Night) -> list[ReplyTimeSpread]:
    """Return the distribution of reply times in every interval in which the mount answered."""
    width = max((night.ended - night.began) / INTERVAL_COUNT, 1e-3)
    parts: dict[int, list[float]] = {}
    for time, took in zip(night.request_times, night.reply_times, strict=True):
        parts.setdefault(int((time - night.began) / width), []).append(took)
    marks = []
    for number, times in sorted(parts.items()):
        times.sort()
        time = night.began + (number + 0.5) * width
        marks.append(ReplyTimeSpread(time, quant(0.05, times), quant(0.5, times), quant(0.95, times), times[-1]))
    return marks


def _scale_maximum(night: Night) -> float:
    """Return the end of the scale of reply times, milliseconds."""
    return max(quant(SHOWN_QUANTILE, sorted(night.reply_times)) * 1000.0 * SCALE_MARGIN, 1.0)


def _scale_step(value: float) -> float:
    """Return the distance of ticks: the first of 1, 2, 5, 10, 20, … that is at least a fifth of ``value``."""
    step = 1.0
    while True:
        for factor in (1.0, 2.0, 5.0):
            if step * factor >= value / 5:
                return step * factor
        step *= 10.0


def plot_reply_times(night: Night) -> str:
    """Plot reply times: medians as a line, 5 % to 95 % as a band, outliers as dots; remarks as red lines."""
    reach = _scale_maximum(night)
    frame = PlotFrame(night.began, night.ended, 0.0, reach, height=220.0)
    step = _scale_step(reach)
    drawn = [frame.axes((step * number, f"{step * number:g} ms") for number in range(int(reach / step) + 1))]
    measured = reply_time_spreads(night)
    for piece in _split_at_gaps(measured, night):
        band = [(frame.x(spread.time), frame.y(spread.quantile_95 * 1000.0)) for spread in piece]
        band += [(frame.x(spread.time), frame.y(spread.quantile_05 * 1000.0)) for spread in reversed(piece)]
        drawn.append(path(band, "spread", closed=True))
        drawn.append(path(((frame.x(spread.time), frame.y(spread.median * 1000.0)) for spread in piece), "middle"))
    for spread in measured:
        if spread.maximum > 1.5 * spread.quantile_95:
            drawn.append(
                tag("circle", cx=frame.x(spread.time), cy=frame.y(spread.maximum * 1000.0), r=1.8, class_="longest")
            )
    for remark in night.remarks:
        x = frame.x(remark.time)
        drawn.append(tag("line", x1=x, x2=x, y1=TOP, y2=frame.foot, class_="fault"))
    return picture(frame.width, frame.height, "".join(drawn), "How long the mount took to answer, over time")


def _split_at_gaps(spreads: list[ReplyTimeSpread], night: Night) -> list[list[ReplyTimeSpread]]:
    """Split a series where the mount did not answer for several intervals."""
    gap = 3.5 * (night.ended - night.began) / INTERVAL_COUNT
    parts: list[list[ReplyTimeSpread]] = []
    for spread in spreads:
        if not parts or spread.time - parts[-1][-1].time > gap:
            parts.append([])
        parts[-1].append(spread)
    return parts


#: Motion faster than this (degrees a second) counts as slewing; a longer gap than this (seconds) breaks the line.
SLEW_SPEED, TRACK_GAP = 0.05, 120.0
#: Seconds between two computed altitudes of the Sun, and how many are computed at most.
SUN_STEP, MAX_SUN_ALTITUDES = 240.0, 400
#: The altitudes of the Sun at which day and twilight end, degrees.
SUNSET_ALTITUDE, NIGHT_ALTITUDE = -0.8, -18.0
CHART_SIZE, CHART_RADIUS = 460.0, 200.0
#: The size of a time label beside a track, pixels.
LABEL_W, LABEL_H = 46.0, 15.0


class TrackPoint(NamedTuple):
    """A position in altitude and azimuth. ``slewing``: the tube was slewing to it; ``continues_track``: a line connects
    it with the position before.
    """

    time: float
    alt: float
    az: float
    slewing: bool
    continues_track: bool


def altaz_track(night: Night, sky: Sky) -> list[TrackPoint]:
    """Return the recorded positions as altitude and azimuth; empty if no site is known."""
    if night.site is None:
        return []
    latitude, longitude, _ = night.site
    points: list[TrackPoint] = []
    for time, ra, dec in night.pointings:
        if night.equinox == "j2000":
            ra, dec = sky.from_j2000(ra, dec, time)
        az, alt = sky.az_alt(ra, dec, latitude, longitude, time)
        joined = bool(points) and time - points[-1].time <= TRACK_GAP
        slewing = joined and separation(az, alt, points[-1].az, points[-1].alt) > SLEW_SPEED * (time - points[-1].time)
        points.append(TrackPoint(time, alt, az, slewing, joined))
    return points


def split_track(points: list[TrackPoint]) -> Iterator[list[TrackPoint]]:
    """Split a track at gaps, and where slewing begins or ends, at a point that both pieces then contain."""
    piece: list[TrackPoint] = []
    for place in points:
        if piece and (not place.continues_track or (len(piece) > 1 and place.slewing != piece[-1].slewing)):
            yield piece
            piece = [piece[-1]] if place.continues_track else []
        piece.append(place)
    if piece:
        yield piece


class LightInterval(NamedTuple):
    """A time interval; its kind is ``day``, ``twilight`` or ``dark``."""

    began: float
    ended: float
    kind: str


def light_intervals(night: Night, sky: Sky) -> list[LightInterval]:
    """Divide the time of the recording into day, twilight and dark; empty without a site or duration."""
    if night.site is None or night.ended <= night.began:
        return []
    step = max(SUN_STEP, (night.ended - night.began) / MAX_SUN_ALTITUDES)
    lights: list[LightInterval] = []
    time = night.began
    while time < night.ended:
        end, kind = min(time + step, night.ended), _light_kind(night, sky, time)
        if lights and lights[-1].kind == kind:
            lights[-1] = lights[-1]._replace(ended=end)
        else:
            lights.append(LightInterval(time, end, kind))
        time = end
    return lights


def _light_kind(night: Night, sky: Sky, time: float) -> str:
    assert night.site is not None
    _, alt = sky.az_alt(*sky.sun(time), night.site.latitude, night.site.longitude, time)
    return "day" if alt > SUNSET_ALTITUDE else "twilight" if alt > NIGHT_ALTITUDE else "dark"


def plot_all_sky(points: list[TrackPoint], night: Night) -> str:
    """Plot the track on the whole sky, in stereographic projection: zenith in the middle, north up, east left."""
    middle = CHART_SIZE / 2
    drawn = [tag("circle", cx=middle, cy=middle, r=CHART_RADIUS, class_="sky")]
    for altitude in (30.0, 60.0):
        drawn.append(tag("circle", cx=middle, cy=middle, r=_chart_distance(altitude), class_="grid"))
        drawn.append(text(f"{altitude:.0f}°", middle + 4, middle - _chart_distance(altitude) - 3, "tick", "start"))
    for altitude in {night.lowest_alt, night.highest_alt} - {0.0, 90.0}:
        drawn.append(tag("circle", cx=middle, cy=middle, r=_chart_distance(altitude), class_="limit"))
    drawn += [
        tag("line", x1=middle - CHART_RADIUS, x2=middle + CHART_RADIUS, y1=middle, y2=middle, class_="grid"),
        tag("line", x1=middle, x2=middle, y1=middle - CHART_RADIUS, y2=middle + CHART_RADIUS, class_="grid"),
    ]
    for azimuth, letter in ((0, "N"), (90, "E"), (180, "S"), (270, "W")):
        x, y = _chart_xy(azimuth, 0.0, CHART_RADIUS + 14)
        drawn.append(text(letter, x, y + 5, "compass"))
    for piece in split_track(points):
        drawn.append(path((_chart_xy(place.az, place.alt) for place in piece), _track_css_class(piece)))
    drawn += _draw_time_labels(points)
    return picture(CHART_SIZE, CHART_SIZE, "".join(drawn), "Where the telescope pointed, over the whole sky")


def _chart_distance(altitude: float) -> float:
    return CHART_RADIUS * math.tan(math.radians(90.0 - max(altitude, -5.0)) / 2)


def _chart_xy(azimuth: float, altitude: float, radius: float | None = None) -> Point:
    reach = _chart_distance(altitude) if radius is None else radius
    turn = math.radians(azimuth)
    return CHART_SIZE / 2 - reach * math.sin(turn), CHART_SIZE / 2 - reach * math.cos(turn)


def _track_css_class(piece: list[TrackPoint]) -> str:
    return "slew" if piece[-1].slewing else "track"


def _draw_time_labels(points: Iterable[TrackPoint]) -> list[str]:
    """Draw dots with the time along the track, where the tube does not slew, as far as there is room."""
    drawn: list[str] = []
    taken: list[Point] = []
    for place in points:
        x, y = _chart_xy(place.az, place.alt)
        is_covered = any(abs(x - a) < LABEL_W and abs(y - b) < LABEL_H for a, b in taken)
        if place.slewing or not place.continues_track or is_covered:
            continue
        drawn.append(tag("circle", cx=x, cy=y, r=3.5, class_="dot"))
        drawn.append(text(format_time_of_day(place.time), x + 7, y + 4, "time", "start"))
        taken.append((x, y))
    return drawn


def plot_altitude(points: list[TrackPoint], lights: list[LightInterval], night: Night) -> str:
    """Plot altitude over time, with day and twilight as background, the limits, and refusals at the bottom."""
    frame = PlotFrame(night.began, night.ended, 0.0, 90.0)
    drawn = [frame.shade(part.began, part.ended, part.kind) for part in lights]
    drawn.append(frame.axes((value, f"{value}°") for value in (0, 30, 60, 90)))
    for limit in {night.lowest_alt, night.highest_alt} - {0.0, 90.0}:
        y = frame.y(limit)
        drawn.append(tag("line", x1=frame.x(night.began), x2=frame.x(night.ended), y1=y, y2=y, class_="limit"))
    for piece in split_track(points):
        drawn.append(path(((frame.x(place.time), frame.y(place.alt)) for place in piece), _track_css_class(piece)))
    for remark in night.refusals:
        x = frame.x(remark.time)
        drawn.append(path(((x, frame.foot), (x - 4, frame.foot + 7), (x + 4, frame.foot + 7)), "refusal", closed=True))
    return picture(frame.width, frame.height, "".join(drawn), "The telescope's altitude over time")
