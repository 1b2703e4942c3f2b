"""What happens in a play: a frozen script, drawn from a seed and made smaller where it fails."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from random import Random

from msgspec import Struct
from msgspec.structs import replace

from tests.property.line_of_faults import KINDS, LONGEST, Fault
from tests.property.orders import RATES, Event

#: name -> protocol, model, version.
MOUNTS: dict[str, tuple[str, str, str | None]] = {
    "cpc": ("nexstar", "cpc", "4.21"), "cge": ("nexstar", "cge", "4.21"), "6-8se": ("nexstar", "6-8se", "4.21"),
    "slt": ("nexstar", "slt", "4.03"), "nexstar-gps-1.2": ("nexstar", "nexstar-gps", "1.2"),
    "nexstar-gps-2.2": ("nexstar", "nexstar-gps", "2.2"), "gt": ("nexstar", "gt", "101.0"),
    "lx200": ("lx200", "lx200", None), "lx200-16": ("lx200", "lx200-16", None),
    "lx200gps": ("lx200", "lx200gps", None), "autostar": ("lx200", "autostar", None),
}  # fmt: skip
#: Hand controls that are told no tracking, and classics, whose alignment it would cost.
KEEPS_TRACKING = {"nexstar-gps-1.2", "gt", "lx200", "lx200-16"}
#: Hand controls that tell neither site nor time.
TELLS_NO_SITE = {"nexstar-gps-1.2", "nexstar-gps-2.2", "gt"}
#: Those that are moved by hand in small gotos.
STEPS = {"nexstar-gps-1.2", "gt"}
#: 2026-06-21 10:00 UTC: day at 45 N 10 E; 2026-01-15 22:00 UTC: night.
DAY, NIGHT = 1782036000.0, 1768514400.0
#: Plays that fail and are not in the suite: mount -> seed -> why.
KNOWN: dict[str, dict[int, str]] = {}
#: Seconds from one event to the next, and from an order to the fault that meets it.
PAUSES = (0.0, 0.02, 0.1, 0.3, 0.6, 1.0, 2.0, 4.0, 8.0, 12.0)
MEETS = (-0.1, 0.0, 0.0, 0.02, 0.1, 0.3, 1.0)
#: How a play ends: a program stops everything, lets go of its arrows, or all programs leave.
ENDINGS = ("stop", "release", "leave")
_PROGRAMS = (
    "goto", "goto", "goto", "arrow", "arrow", "arrow", "release", "release", "stop", "stop", "pulse", "sync", "track",
    "track", "rate", "park", "site", "clock",
)  # fmt: skip
_OWNER = ("key", "key", "unkey", "cancel", "own track", "own site")
_LETTERS = "nsew"


class Script(Struct, frozen=True):
    """``start``: azimuth and altitude at the beginning; ``polled``: whether a program asks for the position."""

    mount: str
    presented: str
    day: bool
    lowest: float
    start: tuple[float, float]
    polled: bool
    latency: float
    ending: str
    events: tuple[Event, ...]
    faults: tuple[Fault, ...]

    def words(self) -> str:
        head = (
            f"{self.mount} as {self.presented}, {'day' if self.day else 'night'}, lowest {self.lowest:g}, from "
            f"azimuth {self.start[0]:.1f} altitude {self.start[1]:.1f}, latency {self.latency:g}, "
            f"{'polled' if self.polled else 'not polled'}, at the end: {self.ending}"
        )
        rows = [(event.at, event.words()) for event in self.events]
        rows += [(fault.at, fault.words()) for fault in self.faults]
        return "\n".join([head, *(f"    {words}" for _, words in sorted(rows))])


def draw(seed: int, mount: str, presented: str | None = None) -> Script:
    """The script of a seed: every second one under the other protocol."""
    random = Random(f"{mount} {seed}")
    if presented is None:
        presented = ("lx200", "nexstar")[seed % 2]
    lowest = random.choice((0.0, 10.0, 20.0))
    low = lowest + 1.0
    day = random.random() < 0.3
    az = random.uniform(230.0, 410.0) % 360.0 if day else random.uniform(0.0, 360.0)  # that day the Sun is at 140
    start = az, random.choice((random.uniform(low, low + 10.0), random.uniform(low, 80.0)))
    events = _events(random, mount, presented, lowest)
    if random.random() < 0.3:  # an arrow that is held down leads to a limit
        start = az, random.uniform(low, low + 8.0)
        arrow = Event(0.5, 1, "arrow", (random.choice(_LETTERS), random.choice(("max", "max", "find"))))
        later = random.choice((3.0, 6.0, 12.0))
        events = (arrow, *(replace(event, at=round(event.at + later, 2)) for event in events[:4]))
    return Script(
        mount,
        presented,
        day,
        lowest,
        start,
        random.random() < 0.6,
        random.choice((0.01, 0.05, 0.05, 0.15)),
        random.choice(ENDINGS),
        events,
        _faults(random, events),
    )


def _events(random: Random, mount: str, presented: str, lowest: float) -> tuple[Event, ...]:
    at, events = 0.0, []
    for _ in range(random.randrange(2, 13)):
        at += random.choice(PAUSES)
        who = 0 if random.random() < 0.15 else random.randrange(1, 4)
        what = random.choice(_PROGRAMS if who else _OWNER)
        if _impossible(what, mount, presented):
            continue
        events.append(Event(round(at, 2), who, what, _how(random, what, lowest)))
    return tuple(events)


def _impossible(what: str, mount: str, presented: str) -> bool:
    """What a protocol has no word for, and what a classic's keypad would do to its alignment."""
    return (what == "park" and presented == "nexstar") or (what == "own track" and mount in ("lx200", "lx200-16"))


def _how(random: Random, what: str, lowest: float) -> tuple[object, ...]:
    if what == "goto":
        alt = random.choice((random.uniform(lowest - 6.0, lowest + 6.0), random.uniform(lowest, 85.0)))
        return round(random.uniform(0.0, 360.0), 2), round(alt, 2)
    if what in ("arrow", "key"):
        return random.choice(_LETTERS), random.choice((*RATES, "max") if what == "arrow" else RATES[1:])
    if what == "release":
        return (random.choice(_LETTERS),)
    if what == "pulse":
        return random.choice(_LETTERS), random.choice((100, 500, 2000))
    if what == "sync":
        return round(random.uniform(-2.0, 2.0), 2), round(random.uniform(-2.0, 2.0), 2)
    if what in ("track", "own track"):
        return (random.random() < 0.6,)
    if what == "rate":
        return (random.choice(("sidereal", "lunar", "solar")),)
    if what in ("site", "own site"):
        return round(random.uniform(-0.3, 0.3), 2), round(random.uniform(-0.3, 0.3), 2)
    return (round(random.uniform(-50.0, 50.0)),) if what == "clock" else ()


def _faults(random: Random, events: tuple[Event, ...]) -> tuple[Fault, ...]:
    """Up to six, most of them where an order is; in every third play none."""
    if not events or random.random() < 0.34:
        return ()
    faults = []
    for _ in range(random.randrange(1, 7)):
        kind = random.choice(KINDS)
        seconds = round(random.uniform(0.2, LONGEST), 1) if kind in ("late", "busy", "cut") else 0.0
        at = round(max(0.0, random.choice(events).at + random.choice(MEETS)), 2)
        faults.append(Fault(at, kind, seconds, random.random() < 0.6))
    return tuple(sorted(faults, key=lambda fault: fault.at))


# --- smaller ------------------------------------------------------------------------------------------------------


def shrink(script: Script, fails: Callable[[Script], bool]) -> Script:
    """The smallest script that still fails, by leaving out faults and events one by one."""
    again = True
    while again:
        again = False
        for smaller in _smaller(script):
            if fails(smaller):
                script, again = smaller, True
                break
    return script


def _smaller(script: Script) -> Iterator[Script]:
    for name in ("faults", "events"):
        row = getattr(script, name)
        if len(row) > 3:
            half = len(row) // 2
            yield replace(script, **{name: row[:half]})
            yield replace(script, **{name: row[half:]})
        for place in range(len(row)):
            yield replace(script, **{name: row[:place] + row[place + 1 :]})
    if script.polled:
        yield replace(script, polled=False)
    if script.day:
        yield replace(script, day=False)
