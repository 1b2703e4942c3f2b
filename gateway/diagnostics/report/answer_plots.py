"""Two plots of the mount's reply times: over the night, and as a histogram."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from gateway.diagnostics.report.night import Night
from gateway.diagnostics.report.svg import TOP, PlotFrame, path, picture, tag

#: The number of intervals of the night, and of bars of the histogram.
PARTS, BARS = 240, 60
#: The vertical scale shows this part of the reply times, times a margin.
SHOWN, ROOM = 0.99, 1.3


class Spread(NamedTuple):
    """The reply times of one interval: its time, the 5 % quantile, the median, the 95 % quantile, the maximum."""

    time: float
    low: float
    middle: float
    high: float
    longest: float


def at(part: float, ordered: Sequence[float]) -> float:
    """Return the quantile ``part`` of sorted values."""
    return ordered[min(len(ordered) - 1, int(part * len(ordered)))]


def spreads(night: Night) -> list[Spread]:
    """Return the spread of every interval in which the mount answered."""
    width = max((night.ended - night.began) / PARTS, 1e-3)
    parts: dict[int, list[float]] = {}
    for time, took in zip(night.asked, night.took, strict=True):
        parts.setdefault(int((time - night.began) / width), []).append(took)
    found = []
    for number, times in sorted(parts.items()):
        times.sort()
        time = night.began + (number + 0.5) * width
        found.append(Spread(time, at(0.05, times), at(0.5, times), at(0.95, times), times[-1]))
    return found


def _reach(night: Night) -> float:
    """Return the longest reply time that is shown, milliseconds."""
    return max(at(SHOWN, sorted(night.took)) * 1000.0 * ROOM, 1.0)


def _round(value: float) -> float:
    """Return a round number of about a quarter of a scale."""
    step = 1.0
    while True:
        for factor in (1.0, 2.0, 5.0):
            if step * factor >= value / 5:
                return step * factor
        step *= 10.0


def over_time(night: Night) -> str:
    """Plot the median as a line, nine of ten as a band, the maxima as dots, and problems as red lines."""
    reach = _reach(night)
    frame = PlotFrame(night.began, night.ended, 0.0, reach, height=220.0)
    step = _round(reach)
    drawn = [frame.axes((step * number, f"{step * number:g} ms") for number in range(int(reach / step) + 1))]
    found = spreads(night)
    for piece in _unbroken(found, night):
        band = [(frame.x(one.time), frame.y(one.high * 1000.0)) for one in piece]
        band += [(frame.x(one.time), frame.y(one.low * 1000.0)) for one in reversed(piece)]
        drawn.append(path(band, "spread", closed=True))
        drawn.append(path(((frame.x(one.time), frame.y(one.middle * 1000.0)) for one in piece), "middle"))
    for one in found:
        if one.longest > 1.5 * one.high:
            drawn.append(tag("circle", cx=frame.x(one.time), cy=frame.y(one.longest * 1000.0), r=1.8, class_="longest"))
    for remark in night.remarks:
        x = frame.x(remark.time)
        drawn.append(tag("line", x1=x, x2=x, y1=TOP, y2=frame.foot, class_="fault"))
    return picture(frame.width, frame.height, "".join(drawn), "How long the mount took to answer, over the time")


def _unbroken(found: list[Spread], night: Night) -> list[list[Spread]]:
    """Split into stretches without a gap."""
    gap = 3.5 * (night.ended - night.began) / PARTS
    parts: list[list[Spread]] = []
    for one in found:
        if not parts or one.time - parts[-1][-1].time > gap:
            parts.append([])
        parts[-1].append(one)
    return parts


def histogram(night: Night) -> str:
    """Plot how many replies took how long."""
    reach, height, width = _reach(night), 220.0, 900.0
    counts = [0] * (BARS + 1)
    for took in night.took:
        counts[min(BARS, int(took * 1000.0 / reach * BARS))] += 1
    frame = PlotFrame(0.0, reach * (BARS + 1) / BARS, 0.0, max(counts) * 1.08, width, height)
    side = (frame.x(frame.ended) - frame.x(0.0)) / (BARS + 1)
    step = _round(max(counts))
    values = [(step * number, f"{step * number:,.0f}") for number in range(int(max(counts) / step) + 1)]
    drawn = [frame.axes_of(values, _milliseconds(reach))]
    for number, count in enumerate(counts):
        top = frame.y(count)
        if count:
            drawn.append(tag(
                "rect", x=frame.x(0.0) + number * side + 0.5, y=top, width=side - 1.0, height=frame.foot - top,
                class_="bar" if number < BARS else "bar longer",
            ))  # fmt: skip
    return picture(width, height, "".join(drawn), "How often the mount took how long to answer")


def _milliseconds(reach: float) -> list[tuple[float, str]]:
    step = _round(reach) / 2 if _round(reach) >= 2 else _round(reach)
    ticks = [(step * number, f"{step * number:g} ms") for number in range(int(reach / step) + 1)]
    return [*ticks[:-1], (reach, "longer")] if reach - ticks[-1][0] < step / 2 else [*ticks, (reach, "longer")]
