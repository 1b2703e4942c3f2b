"""The status line: which mount it is, where it points, what it does, how many programs are connected, how busy it is.

Functions turn values into text; none asks the mount. If the terminal is too narrow, the least important parts are left
out first, and the same parts for every mount.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from msgspec import Struct

from gateway.core.operations import Equatorial, Status
from gateway.protocols.wireformat.sexagesimal import hours, signed

#: A position older than this many seconds is shown with its age.
MAX_POSITION_AGE = 10.0
#: The first two parts, name and position, are shown at any width.
MIN_PARTS = 2


class StatusLine(Struct, frozen=True):
    """The last known state of one mount. ``state`` is the state of its line, ``age`` the position's age in seconds.

    ``rate`` is exchanges with the mount per second. ``by_hand`` includes motion at the hand control's keys.
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
    #: A motion was ended, and the position does not show the mount at rest yet.
    ends: bool = False
    #: The mount has not reported a position since a motion was ended.
    unknown: bool = False
    parked: bool = False

    @property
    def moves(self) -> bool:
        """Whether the mount moves, except by tracking and guiding, or is not yet seen at rest after a motion."""
        return self.slewing or self.by_hand or self.ends

    @property
    def online(self) -> bool:
        """Whether the mount answers."""
        return self.state in ("up", "busy")


class ServedSurface(Struct, frozen=True):
    """A surface, or the console: the address at which it is open (``at``), and those for other computers now."""

    name: str
    at: str
    addresses: tuple[str, ...] = ()
    #: A sentence: what to type on another computer or a phone, or that no other computer can reach the surface.
    words: str = ""

    def __str__(self) -> str:
        return f"{self.name} {self.at}{'; ' * bool(self.words)}{self.words}"


class State(Struct, frozen=True):
    """The known state of a mount: its activity, its orders, its limits, and the state of its line.

    Texts are for the user, and empty if nothing is known. ``folder`` is the gateway's state folder; ``unopened`` says
    why the mount's port cannot be opened.
    """

    look: StatusLine
    mount: str
    product: str = ""
    model: str = ""
    version: str = ""
    #: The orders under way and the waiting ones.
    wanted: tuple[str, ...] = ()
    #: The limits in effect.
    allowed: tuple[str, ...] = ()
    site: str = ""
    clock: str = ""
    programs: tuple[str, ...] = ()
    #: The mount's typical reply time in seconds, and the number of its replies so far.
    reply: float = 0.0
    answers: int = 0
    #: Refusals and the gateway's own actions in the last minute.
    lately: tuple[str, ...] = ()
    served: tuple[ServedSurface, ...] = ()
    folder: str = ""
    unopened: str = ""
    #: The usual name of a mount that reports another name.
    title: str = ""
    #: What the sky at the mount's time is calculated from: ``almanac of YYYY-MM-DD``, or ``closed form``.
    sky: str = ""

    @property
    def identity_text(self) -> str:
        """The identity that the mount reported; empty before that."""
        version = f", version {self.version}" if self.version and self.version != "?" else ""
        return f"{self.title or self.product}, {self.model}{version}" if self.product else ""


class AverageRate:
    """The rate of a counter that is sampled now and then, averaged over the last ``sample_count`` samples."""

    def __init__(self, sample_count: int = 5) -> None:
        self._samples: deque[tuple[float, int]] = deque(maxlen=sample_count + 1)

    def add_sample(self, now: float, count: int) -> float:
        """Add a sample, ``count`` at the time ``now`` (seconds), and return the rate per second; 0 at first."""
        self._samples.append((now, count))
        then, before = self._samples[0]
        return (count - before) / (now - then) if now > then else 0.0


def status_text(lines: Sequence[StatusLine], columns: int | None = None) -> str:
    """Return all mounts on one line of at most ``columns`` characters; None: of any length."""
    parts = [_parts_of(line) for line in lines]
    text = ""
    for count in range(len(parts[0]), MIN_PARTS - 1, -1):
        text = "  |  ".join("  ".join(part for part in of_one[:count] if part) for of_one in parts)
        if columns is None or len(text) <= columns:
            return text
    assert columns is not None
    return text[: columns - 1] + "…" if columns > 0 else ""


def _parts_of(line: StatusLine) -> list[str]:
    """Return name, position, activity, programs and rate; a part that is not known is empty."""
    if not line.online:
        points, is_doing = f"{line.state}{': ' if line.reason else ''}{line.reason}", ""
    else:
        points, is_doing = position_text(line), activity(line)
    programs = f"{line.programs or 'no'} program{'' if line.programs == 1 else 's'}"
    return [line.name, points, is_doing, programs, f"{line.rate:.1f}/s"]


def position_text(line: StatusLine) -> str:
    """Return where the mount points, as text."""
    if line.position is None:
        return "no position yet"
    old = f" {line.age:.0f} s ago" if line.age > MAX_POSITION_AGE else ""
    return f"{format_position(line.position)}{old}"


def format_position(position: Equatorial) -> str:
    """Return a position as people write it: ``05:34:32 +22°00'52"``."""
    degrees, minutes, seconds = signed(position.dec).replace("*", ":").split(":")
    return f"{hours(position.ra)} {degrees}°{minutes}'{seconds}\""


def activity(line: StatusLine) -> str:
    """Return the activity in a few words, preceded by ``held`` if nothing may move the mount."""
    return "held, " * line.held + _condition_text(line) if _condition_text(line) else "held" * line.held


def _condition_text(line: StatusLine) -> str:
    """Return the most important activity or condition of the mount in a few words; empty if not known."""
    if line.unknown:
        return "not known whether it moves"
    if line.slewing:
        return "slewing"
    if line.by_hand:
        return "moved by hand"
    if line.ends:
        return "coming to rest"
    if line.state == "busy":
        return "busy"
    if line.asleep:
        return "asleep"
    if line.status is None:
        return ""
    if not line.status.aligned:
        return "not aligned"
    if line.status.tracking.value != "off":
        return "tracking"
    return "parked" if line.parked else "not tracking"
