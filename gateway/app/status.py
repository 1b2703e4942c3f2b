"""The status line: which mount, where it points, what it does, who is connected, how busy its connection is.

Values in, text out; nothing here asks the mount. Where the terminal is too narrow, the least important parts are left
out first, for every mount alike.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from msgspec import Struct

from gateway.core.operations import Equatorial, Status
from gateway.protocols.wireformat.sexagesimal import hours, signed

#: A position older than this many seconds is told with its age.
OLD = 10.0
#: The name and the position stay, whatever the width.
LEAST = 2


class StatusLine(Struct, frozen=True):
    """One mount as it was seen last. ``state`` is the line's, ``age`` that of the position in seconds.

    ``rate`` is in exchanges with the mount per second.
    """

    name: str
    state: str
    reason: str = ""
    position: Equatorial | None = None
    age: float = 0.0
    slewing: bool = False
    by_hand: bool = False
    status: Status | None = None
    programs: int = 0
    rate: float = 0.0
    asleep: bool = False
    held: bool = False


class State(Struct, frozen=True):
    """All that is known of a mount: what is seen, what is wanted of it, what it is allowed, and how its line is.

    Sentences are as a person reads them, empty where nothing is known. ``reply`` is how long it takes to answer in
    seconds, ``answers`` how many it has given; ``lately`` is what was refused, or done
    by the gateway itself, in the last minute.
    """

    look: StatusLine
    mount: str
    product: str = ""
    model: str = ""
    version: str = ""
    wanted: tuple[str, ...] = ()
    allowed: tuple[str, ...] = ()
    site: str = ""
    clock: str = ""
    programs: tuple[str, ...] = ()
    reply: float = 0.0
    answers: int = 0
    lately: tuple[str, ...] = ()

    @property
    def found(self) -> str:
        """Which mount this is, in its own words; empty before it has said so."""
        version = f", version {self.version}" if self.version and self.version != "?" else ""
        return f"{self.product}, {self.model}{version}" if self.product else ""


class Rate:
    """How often something happens, from a count that is looked at now and then: over the last ``looks`` looks."""

    def __init__(self, looks: int = 5) -> None:
        self._seen: deque[tuple[float, int]] = deque(maxlen=looks + 1)

    def per_second(self, now: float, count: int) -> float:
        """The count has come to this at ``now`` (seconds) -> times per second; 0 at the first look."""
        self._seen.append((now, count))
        then, before = self._seen[0]
        return (count - before) / (now - then) if now > then else 0.0


def status(looks: Sequence[StatusLine], columns: int | None = None) -> str:
    """All mounts on one line, no longer than ``columns`` where that is given."""
    parts = [_parts(look) for look in looks]
    text = ""
    for kept in range(len(parts[0]), LEAST - 1, -1):
        text = "  |  ".join("  ".join(part for part in of_one[:kept] if part) for of_one in parts)
        if columns is None or len(text) <= columns:
            return text
    assert columns is not None
    return text[: columns - 1] + "…" if columns > 0 else ""


def _parts(look: StatusLine) -> list[str]:
    """Name, position, activity, programs, rate; what is not known is empty."""
    if look.state in ("opening", "down"):
        points, is_doing = f"{look.state}{': ' if look.reason else ''}{look.reason}", ""
    else:
        points, is_doing = where(look), does(look)
    programs = f"{look.programs or 'no'} program{'' if look.programs == 1 else 's'}"
    return [look.name, points, is_doing, programs, f"{look.rate:.1f}/s"]


def where(look: StatusLine) -> str:
    """Where it points, in words."""
    if look.position is None:
        return "no position yet"
    old = f" {look.age:.0f} s ago" if look.age > OLD else ""
    return f"{on_the_sky(look.position)}{old}"


def on_the_sky(place: Equatorial) -> str:
    """A place as people write it: ``05:34:32 +22°00'52"``."""
    degrees, minutes, seconds = signed(place.dec).replace("*", ":").split(":")
    return f"{hours(place.ra)} {degrees}°{minutes}'{seconds}\""


def does(look: StatusLine) -> str:
    """A few words: whether it is held from being moved, and how it is."""
    return "held, " * look.held + _is(look) if _is(look) else "held" * look.held


def _is(look: StatusLine) -> str:
    """One word or two, the most urgent ones: what it is busy with, else how it was left."""
    if look.slewing:
        return "slewing"
    if look.by_hand:
        return "moved by hand"
    if look.state == "busy":
        return "busy"
    if look.asleep:
        return "asleep"
    if look.status is None:
        return ""
    if not look.status.aligned:
        return "not aligned"
    return "not tracking" if look.status.tracking.value == "off" else "tracking"
