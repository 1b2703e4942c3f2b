"""SVG as text: elements, paths, and the frame of a plot with its two scales. All text and attributes are escaped."""

from __future__ import annotations

import html
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime

#: Margins of a plot for its labels, pixels.
LEFT, RIGHT, TOP, BOTTOM = 58.0, 14.0, 12.0, 26.0
#: Possible intervals between the ticks of a time axis, seconds; the greatest number of ticks.
STEPS = (10, 30, 60, 300, 600, 1800, 3600, 7200, 10800, 21600, 86400)
MAX_TICKS = 9

Point = tuple[float, float]


def tag(name: str, content: str = "", /, **attributes: object) -> str:
    """Return an SVG element, as in ``tag("line", x1=1, class_="axis")``; the content must be SVG already."""
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{_attribute(value)}"' for key, value in attributes.items()
    )
    return f"<{name}{written}>{content}</{name}>"


def _attribute(value: object) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".") if isinstance(value, float) else html.escape(str(value))


def text(content: str, x: float, y: float, class_: str = "", anchor: str = "middle") -> str:
    """Return a text element; the words are escaped."""
    return tag("text", html.escape(content), x=x, y=y, class_=class_, text_anchor=anchor)


def path(points: Iterable[Point], class_: str, closed: bool = False) -> str:
    """Return a path of straight lines through points, as an SVG element."""
    drawn = "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
    return tag("path", d=f"M{drawn}{'Z' * closed}", class_=class_) if drawn else ""


def picture(width: float, height: float, content: str, label: str) -> str:
    """Return a complete SVG picture; ``label`` describes it for screen readers."""
    return tag("svg", content, viewBox=f"0 0 {width:g} {height:g}", role="img", aria_label=label)


def format_time_of_day(unix: float, with_seconds: bool = False) -> str:
    """Format Unix seconds as the time of day, UTC."""
    return datetime.fromtimestamp(unix, UTC).strftime("%H:%M:%S" if with_seconds else "%H:%M")


@dataclass(frozen=True)
class PlotFrame:
    """The frame of a plot over time: the ranges of times and values, and its size in pixels."""

    began: float
    ended: float
    min_value: float
    max_value: float
    width: float = 900.0
    height: float = 250.0

    def x(self, time: float) -> float:
        """Return the x coordinate of a time (Unix seconds), pixels."""
        span = max(self.ended - self.began, 1e-3)
        return LEFT + (time - self.began) / span * (self.width - LEFT - RIGHT)

    def y(self, value: float) -> float:
        """Return the y coordinate of a value, limited to the scale, pixels."""
        part = (value - self.min_value) / (self.max_value - self.min_value)
        return self.height - BOTTOM - min(1.0, max(0.0, part)) * (self.height - TOP - BOTTOM)

    @property
    def foot(self) -> float:
        """The y coordinate of the lower edge, pixels."""
        return self.height - BOTTOM

    def shade(self, began: float, ended: float, class_: str) -> str:
        """Shade an interval of time from top to bottom."""
        return tag(
            "rect", x=self.x(began), y=TOP, width=self.x(ended) - self.x(began), height=self.foot - TOP, class_=class_
        )

    def axes(self, values: Iterable[tuple[float, str]]) -> str:
        """Draw the grid lines and labels of the value scale and of the time scale."""
        brief = self.ended - self.began < 300
        drawn = [
            tag("line", x1=LEFT, x2=self.width - RIGHT, y1=self.y(value), y2=self.y(value), class_="grid")
            + text(label, LEFT - 8, self.y(value) + 4, "tick", "end")
            for value, label in values
        ]
        for time in self.tick_times():
            drawn.append(tag("line", x1=self.x(time), x2=self.x(time), y1=TOP, y2=self.foot, class_="grid"))
            drawn.append(text(format_time_of_day(time, brief), self.x(time), self.height - 8, "tick"))
        return "".join(drawn)

    def tick_times(self) -> list[float]:
        """Return the times of the ticks, Unix seconds."""
        step = next((length for length in STEPS if (self.ended - self.began) / length <= MAX_TICKS), STEPS[-1])
        first = -(-self.began // step) * step
        return [first + number * step for number in range(int((self.ended - first) // step) + 1)]
