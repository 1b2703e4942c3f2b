"""Reply verification: accept a reply that is plausible after the last one, otherwise ask again until several agree.

A byte that was changed on the way can leave a reply's form intact. So a reply like the last one is accepted at once.
Any other is asked for again until replies in a row agree: two where the mount can have moved that far, three where it
cannot or where the value seldom changes, and one more than the late replies that may still come. A reply that took
unusually long is not counted.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping
from typing import Any

from msgspec import Struct

from gateway.astro.spherical import wrap180
from gateway.core.errors import Busy, Fault, Garbled, NoAnswer, Silence
from gateway.mount.link.line import MountLink
from gateway.mount.link.queue import AT_ONCE, STOP
from gateway.protocols.base.driver import Send

#: Degrees that a position may differ from the last one and be believed at once.
NEAR = 0.05
#: Degrees a second that any mount moves at most on one axis, and the worst of both together.
FASTEST = 8.0 * math.sqrt(2.0)
#: Degrees that a latitude grows at most between two answers in a row.
POLEWARD = 2.0
#: Seconds that a clock may be off what it said before; it tells whole seconds, and answers take their time.
CLOCK = 1.6
#: Seconds an answer may take, on a line that is usually quick: one that took longer may be as old as that.
PROMPT, SLOW_TRIES = 0.5, 3
#: How often something is asked, and how often when the answer was garbled.
TRIES, GARBLED_TRIES = 9, 3
#: Timers come up to so much too early: who waits for the rest of it waits at least so long.
TICK = 0.001
#: An order waits so long, in seconds, until older ones like it can no longer be answered.
DOUBTFUL = 12.0
#: Answers to older questions that are reckoned with at a time: of one more that agree, one is no stranger.
MOST_STRANGERS = 4
#: How many questions' last answers are remembered: programs may ask for devices without end.
KNOWN = 100
DAY = 86400.0
#: What is told of an answer's form, not of its meaning.
_FORM = ("length", "raw")
#: The angles on a sphere: each longitude with its latitude.
_LATITUDE = {"ra": "dec", "az": "alt", "longitude": "latitude"}


class Heard(Struct):
    """An answer, or the fault that is one (silence, no such device), and when its question was sent and it came."""

    values: Mapping[str, Any]
    fault: Fault | None
    asked: float
    came: float


class ReplyVerifier:
    """Between the drivers and the line. A simulated mount slews ``speed_factor`` times faster than a real one."""

    def __init__(self, line: MountLink, now: Callable[[], float], speed_factor: float = 1.0) -> None:
        self._line, self._now, self._fastest = line, now, FASTEST * speed_factor
        self._late = line.talk.late
        self._known: dict[tuple[Any, ...], Heard] = {}
        self._latitudes: dict[str, float] = {}

    async def exchange(self, ask: Send, rank: int) -> tuple[Heard, int]:
        """An answer that can be believed, and how many exchanges that took. Raises Fault."""
        kind = self._line.dialogue.expected(ask).kind
        if kind is None:
            asked = self._now()
            return Heard(await self._order(ask, rank), None, asked, self._now()), 1
        key = (ask.command, ask.raw, *sorted((name, value) for name, value in ask.values.items() if name != "low"))
        row: list[Heard] = []
        longest = slow = strangers = 0
        times = 0
        while times < TRIES:
            times += 1
            strangers = max(strangers, self._late.count(ask, self._now()))
            heard = await self._hear(ask, rank)
            mute = isinstance(heard.fault, Silence)  # which takes its time always
            if mute and not ask.raw:
                break  # whoever asks so knows what to make of it
            if ask.light:
                break
            took = heard.came - heard.asked
            if slow < SLOW_TRIES and not mute and took > PROMPT and took > 2.5 * self._line.typical:
                slow += 1
                continue
            if not (row and self._agree(kind, row[-1], heard)):
                row.clear()
            row.append(heard)
            longest = max(longest, len(row))
            if len(row) >= self._wanted(kind, self._known.get(key), heard, strangers):
                break
        else:
            if len(row) < 2 and not (kind == "position" and longest == 1):  # a place may change that fast, and no other
                raise Garbled
        self._remember(key, heard)
        self._latitudes |= {name: heard.values[name] for name in _LATITUDE.values() if name in heard.values}
        if heard.fault is not None:
            raise type(heard.fault)(str(heard.fault))  # what is raised holds on to whoever asked
        return heard, times

    def _remember(self, key: tuple[Any, ...], heard: Heard) -> None:
        """The last answer; of too many the one that was heard longest ago is forgotten."""
        self._known.pop(key, None)
        self._known[key] = heard
        if len(self._known) > KNOWN:
            del self._known[next(iter(self._known))]

    async def _order(self, ask: Send, rank: int) -> Mapping[str, Any]:
        """A command that changes something: not before its acknowledgement can be told from an older one's.

        A stop never waits: it is sent until one of its acknowledgements must be its own.
        """
        if rank != STOP:
            try:
                async with asyncio.timeout(AT_ONCE if ask.prompt else DOUBTFUL):
                    while (left := self._late.until(ask, self._now()) - self._now()) > 0:
                        await asyncio.sleep(max(left, TICK))
            except TimeoutError:  # others like it go on failing: nobody is kept waiting for the end of that
                raise NoAnswer from None
            return await self._line.exchange(ask, rank)
        times = 0
        while True:
            strangers = self._late.count(ask, self._now())
            answer = await self._line.exchange(ask, rank)
            times += 1
            if times > min(strangers, MOST_STRANGERS):
                return answer

    async def _hear(self, ask: Send, rank: int) -> Heard:
        """One answer; garbled ones are asked again. Raises NoAnswer and Busy."""
        for attempt in range(GARBLED_TRIES):
            values: Mapping[str, Any] = {}
            fault: Fault | None = None
            try:
                values, took = await self._line.timed(ask, rank)
            except Garbled:
                if attempt == GARBLED_TRIES - 1:
                    raise
                continue
            except (NoAnswer, Busy):  # neither says anything about the mount
                raise
            except Fault as said:
                fault, took = said.with_traceback(None), said.took
            came = self._now()
            return Heard(values, fault, came - took, came)
        raise NoAnswer

    def _wanted(self, kind: str, known: Heard | None, heard: Heard, strangers: int) -> int:
        """How many answers in a row must agree with this one to be believed."""
        least = min(strangers, MOST_STRANGERS) + 1
        if known is None:
            return max(2, least)
        if kind != "position":
            return least if self._agree(kind, known, heard) else max(3, least)
        if known.values.get("length") != heard.values.get("length"):  # in high precision now, or in low
            return max(2, least)
        gone = self._distance(known, heard)
        if gone <= NEAR:
            return least
        return max(2, least) if gone <= self._reach(known, heard) else max(3, least)

    def _agree(self, kind: str, before: Heard, after: Heard) -> bool:
        """Whether both can be true."""
        if before.fault is not None or after.fault is not None:
            return type(before.fault) is type(after.fault)
        if kind == "position":
            reach = self._reach(before, after)
            return self._distance(before, after, min(POLEWARD, reach)) <= reach
        if kind == "clock":
            return _runs_on(before, after)
        return before.values == after.values

    def _reach(self, before: Heard, after: Heard) -> float:
        """Degrees that the mount can have moved between two answers, and while the first one came."""
        took = min(before.came - before.asked, 2.5 * self._line.typical)
        return NEAR + self._fastest * (after.came - before.came + took)

    def _distance(self, before: Heard, after: Heard, poleward: float = 0.0) -> float:
        """Degrees between two answers; infinite when they differ in form.

        Where the latitude comes by a question of its own, it may have grown by ``poleward`` since.
        """
        if before.fault is not None or after.fault is not None or before.values.keys() != after.values.keys():
            return math.inf
        if before.values.get("length") != after.values.get("length"):
            return math.inf
        total = 0.0
        for name, value in after.values.items():
            if name in _FORM:
                continue
            apart = wrap180(value - before.values[name])
            if name in _LATITUDE:
                latitude = after.values.get(_LATITUDE[name])
                if latitude is None:
                    latitude = min(90.0, abs(self._latitudes.get(_LATITUDE[name], 0.0)) + poleward)
                apart *= math.cos(math.radians(latitude))
            total += apart * apart
        return math.sqrt(total)


def _seconds(values: Mapping[str, Any]) -> float:
    if "time" in values:
        return float(values["time"])
    return float(values["hour"] * 3600 + values["minute"] * 60 + values["second"])


def _runs_on(before: Heard, after: Heard) -> bool:
    """Whether a clock that told the one may tell the other; its date may change at midnight only."""
    then, now = _seconds(before.values), _seconds(after.values)
    gone = (now - then - (after.came - before.came) + DAY / 2) % DAY - DAY / 2
    slack = CLOCK + (before.came - before.asked) + (after.came - after.asked)
    others = [name for name in after.values if name not in ("time", "hour", "minute", "second", *_FORM)]
    return abs(gone) <= slack and (now < then or all(before.values.get(n) == after.values[n] for n in others))
