"""The judge of a play: by the axes of the simulated mount, and by what the programs and the person have ordered.

Always: within the limits, but for the way that the mount goes while no stop can reach it and until it is seen. When all
is over: nothing moves, what is told is so, tracking is as it was wanted last, and nothing that somebody undid is back.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from math import hypot
from typing import Any

from gateway.astro.spherical import separation, wrap180
from gateway.protocols.mechanics.truth import Truth, truth_of
from tests.property.line_of_faults import FaultyLine
from tests.property.orders import Event, polar, sited
from tests.property.scripts import KEEPS_TRACKING, MOUNTS, STEPS, TELLS_NO_SITE, Script
from tests.support.in_process_gateway import RehearsalClient

#: Degrees: what rounding and refraction explain. Seconds: from one look of the gateway at a mount that it moves to the
#: next, and at one that it does not; and what it takes after a fault until a command is heard.
SLACK, LOOK, IDLE_LOOK, RECOVERED = 0.4, 1.5, 6.0, 7.0
#: The Sun is up, altitude; how near to it the tube may come; how far past the meridian.
RISEN, CIRCLE, PAST = -0.8, 20.0, 22.5
#: Seconds within which two orders about the same count as one: either may be the last. A lost one may have been heard.
TOGETHER, DOUBTFUL = 3.0, 14.0
#: Degrees a second that are no tracking; arcseconds a second that a drive may be off.
CREEP, DRIFT = 0.01, 0.15
_DRIVES = {"sidereal": 0.0, "lunar": 15.041 - 14.685, "solar": 0.041}
Until = Callable[[float], Awaitable[None]]


class Judge:
    """``complaints`` are in words, the kind first."""

    def __init__(self, bridge: Any, script: Script, wire: FaultyLine, began: float) -> None:
        self.bridge, self.sim, self.script, self.wire, self.began = bridge, bridge.sim, script, wire, began
        self.now = asyncio.get_running_loop().time
        self.complaints: list[str] = []
        self.events: list[Event] = []
        self._speeds: list[tuple[float, float]] = []
        self._outside: dict[str, float] = {}
        self._told: set[str] = set()
        self._keyed = self._slewed = -1e9
        self._busy: list[tuple[float, float]] = []
        self._lenient = False
        self._cancelled: float | None = None
        self._meade = MOUNTS[script.mount][0] == "lx200"

    def complain(self, kind: str, words: str) -> None:
        if kind not in self._told:
            self._told.add(kind)
            self.complaints.append(f"{kind}: at {self.now() - self.began:.1f} s {words}")

    def hear(self, event: Event) -> None:
        """Something is ordered."""
        self.events.append(event)
        self._lenient = self._lenient or event.what == "park"
        if event.what in ("goto", "arrow", "park", "key"):
            self._cancelled = None
        steps = any(one.what == "arrow" for one in self.events) and self.script.mount in STEPS
        if event.what == "cancel" and not self.blind() and self.sim.slewing and not steps:
            self._cancelled = self.now()

    # --- always -------------------------------------------------------------------------------------------------------

    def blind(self) -> float:
        """Seconds for which no stop may have reached the mount until now, and nothing of it been seen."""
        since, now = None, self.now()
        for start, end in [*self.wire.spoilt, *self._busy]:
            if now <= end + RECOVERED + LOOK:
                since = start if since is None else min(since, start)
        return 0.0 if since is None else now - since

    def look(self) -> bool:
        """Compare with the limits -> whether anything moves."""
        truth, now, fastest = truth_of(self.sim), self.now(), float(self.sim.mechanics.max_rate)
        speed = hypot(truth.rate1, truth.rate2)
        if self.sim.now < getattr(self.sim, "busy_until", 0.0):  # it hears nothing
            self._busy = [(self._busy[0][0] if self._busy else now, now)]
        if truth.moving and any(event.what == "key" for event in self.events[-4:]):
            self._keyed = now
        if self.sim.slewing or self.script.mount in STEPS:
            self._slewed = now
        blind = self.blind()
        unseen = blind + LOOK if blind else 0.0
        unseen += IDLE_LOOK if now - self._keyed < IDLE_LOOK else 0.0
        self._speeds = [(at, was) for at, was in self._speeds if at > now - unseen - 2.0] + [(now, speed)]
        most = max(was for _, was in self._speeds)
        margin = SLACK + self._sync_error() + (most * (unseen + 0.75 * most / fastest) if unseen else 0.0)
        if now - self._slewed < 3.0:
            margin += fastest * (0.6 + 4.0 * self.script.latency)
        for name, beyond in self._beyond(truth).items():
            if beyond <= 0.0:
                self._outside.pop(name, None)
                continue
            allowed = self._outside[name] = max(margin, self._outside.get(name, 0.0))
            if beyond > allowed:
                self.complain(
                    name,
                    f"{beyond:.1f} degrees beyond the limit, {allowed:.1f} allowed, at {speed:.2f} degrees a second",
                )
        self._look_at_goal(truth)
        if self._cancelled is not None and now > self._cancelled + 1.5 and self.sim.slewing:
            self.complain("undone", "a goto that was cancelled at the keys goes on")
        return truth.moving

    def _look_at_goal(self, truth: Truth) -> None:
        """A goto beyond the limit is refused: the mount never comes to its goal."""
        goals = [event.how for event in self.events if event.what == "goto"]
        for az, alt in goals[-2:]:
            if (
                alt < self.script.lowest - 0.6 - self._sync_error()
                and separation(az, alt, truth.azimuth, truth.altitude) < 0.4
            ):
                self.complain("goal", f"a goto has come to altitude {truth.altitude:.1f}")

    def _beyond(self, truth: Truth) -> dict[str, float]:
        found = {} if self._lenient else {"low": self.script.lowest - truth.altitude}
        if self._sun_is_up(truth):
            found["sun"] = CIRCLE - truth.sun_distance
        if truth.past_meridian is not None and self.script.mount == "cge" and not self._lenient:
            found["meridian"] = truth.past_meridian - PAST
        return found

    def _sun_is_up(self, truth: Truth) -> bool:
        return self.script.day

    def _sync_error(self) -> float:
        """How far syncs have moved what the mount, or the gateway for it, believes."""
        first, second = self.sim.mechanics.sync_correction
        kept = getattr(self.bridge.driver, "sync_offset", (0.0, 0.0))
        moved = any(event.what in ("site", "own site", "clock") for event in self.events)
        return hypot(wrap180(first), wrap180(second)) + hypot(*kept) + 0.6 * moved

    # --- in the end ---------------------------------------------------------------------------------------------------

    def goto_wanted(self) -> bool:
        """Whether a goto may still be under way: nobody has ended it since."""
        for place, event in reversed(list(enumerate(self.events))):
            if event.what in ("goto", "park"):
                return True
            if event.what in ("stop", "arrow", "key", "cancel") or (
                event.what == "release" and not self._pressed_before(place, event)
            ):
                return False
        return False

    def _pressed_before(self, place: int, release: Event) -> bool:
        """Whether this program has pressed an arrow of that axis: then letting it go ends no goto that came after."""
        axis = "ns" if release.how[0] in "ns" else "we"
        for event in reversed(self.events[:place]):
            if event.who == release.who and event.what in ("arrow", "release") and event.how[0] in axis:
                return event.what == "arrow"
        return False

    def guides_on(self) -> bool:
        """Whether somebody has left a guide arrow on: the dead man's switch takes that for tracking of his own."""
        on: set[str] = set()
        for event in self.events:
            if event.what == "arrow" and event.how[1] == "guide":
                on.add("ns" if event.how[0] in "ns" else "we")
            elif event.what == "stop":  # a goto may have been refused
                on.clear()
        return bool(on) and self.script.ending == "leave"

    async def verdict(self, until: Until, client: RehearsalClient) -> None:
        """All is over: look for some seconds, and ask."""
        sim, at = self.sim, self.now() - self.began
        truth, rates = truth_of(sim), self._rate(truth_of(sim))
        if self.guides_on():
            return
        if truth.moving and not self.goto_wanted():
            self.complain("moves", f"{rates} degrees a second, slewing {sim.slewing}")
        if self.bridge.controller.moving and not truth.moving:
            self.complain("told moving", "while it rests")
        before = sim.true_position()
        await until(at + 10.0)
        after, truth = sim.true_position(), truth_of(sim)
        synced = any(event.what == "sync" for event in self.events) and not polar(sim)  # follows another place's sky
        drift = wrap180(after[0] - before[0]) * 360.0
        wanted = self.tracking_wanted()
        if wanted is not None and not truth.moving and truth.tracking is not wanted:
            self.complain("tracking", f"is {truth.tracking}, {wanted} was wanted last")
        rate = self.rate_wanted()
        if (
            rate is not None
            and truth.tracking
            and not truth.moving
            and wanted
            and not synced
            and (abs(drift - _DRIVES[rate]) > DRIFT + 0.5 * self._sync_error())
        ):
            self.complain("drift", f"{drift:.2f} arcseconds a second, the drive is to be {rate}")
        if not truth.tracking and not truth.moving and hypot(truth.rate1, truth.rate2) > CREEP:
            self.complain("creeps", f"{self._rate(truth)} degrees a second")
        await self._settings(until, client)

    @staticmethod
    def _rate(truth: Truth) -> str:
        return f"{truth.rate1:.3f} {truth.rate2:.3f}"

    def _doubtful(self, event: Event, *others: str) -> bool:
        """Whether an order met a fault, or came together with another one about the same."""
        if any(
            event.at < end - self.began + DOUBTFUL and start - self.began < event.at + DOUBTFUL
            for start, end in self.wire.spoilt
        ):
            return True
        return any(
            other is not event and other.what in others and abs(other.at - event.at) < TOGETHER for other in self.events
        )

    def tracking_wanted(self) -> bool | None:
        """What was wanted last; None where nobody can say."""
        wanted: bool | None = True
        for event in self.events:
            if event.what == "park":
                wanted = None
            elif event.what == "own track" or (event.what == "track" and self.script.mount not in KEEPS_TRACKING):
                sure = not self._doubtful(
                    event, "track", "own track", "arrow", "release", "stop", "goto", "key", "pulse", "park"
                )
                wanted = event.how[0] if sure else None
        limits = any(
            "tracking is off: it came to" in entry.note
            or "rests and comes to" in entry.note
            or "cannot be switched off" in entry.note
            for entry in self.bridge.entries
        )
        return None if limits else wanted

    def rate_wanted(self) -> str | None:
        """The drive rate wanted last, of a polar mount."""
        wanted: str | None = "sidereal"
        for event in self.events:
            if event.what == "rate" and (polar(self.sim) or self._meade):
                wanted = None if self._doubtful(event, "rate") else event.how[0]
            elif event.what in ("own track", "key", "cancel") or event.what == "park":
                wanted = None  # the hand control goes on at its own rate
        return wanted

    async def _settings(self, until: Until, client: RehearsalClient) -> None:
        """The site that is told is the last one that was set, or the mount's."""
        sites = [event for event in self.events if event.what in ("site", "own site")]
        if not sites or (self.script.mount in TELLS_NO_SITE and sites[-1].what == "own site"):
            return
        meade = self.script.presented == "lx200"
        if sites[-1].what == "own site":  # looked for every so often while somebody polls
            for _ in range(70):
                client.send(b":GR#" if meade else b"e")
                await until(self.now() - self.began + 1.0)
        told = _site(await client.ask(b":Gt#:Gg#" if meade else b"w", 5.0, ending=b"#"), meade)
        if meade:
            await until(self.now() - self.began + 1.0)
            told = _site(client.received, True)
        mine = self.sim.site if self._meade else self.sim.mechanics.sky[:2]
        if told is None:
            self.complain("site", f"{client.received!r} is told")
            return
        last = sites[-1]
        is_mounts = separation(told[1], told[0], mine[1], mine[0]) < 0.04
        set_last = sited(self.sim, *last.how)
        is_set = separation(told[1], told[0], set_last[1], set_last[0]) < 0.04
        doubtful = self._doubtful(last, "site", "own site")
        if not is_mounts and not is_set and not doubtful:
            self.complain("site", f"{told} is told, the mount has {mine}, set was {set_last}")
        if last.what == "own site" and not doubtful:
            if separation(mine[1], mine[0], set_last[1], set_last[0]) > 0.04:
                self.complain("undone", f"the site of the keys, {set_last}, has become {mine}")
            elif not is_mounts:
                self.complain("site", f"{told} is told, the owner has set {set_last} at the keys")
        if last.what == "site" and is_set and not is_mounts and self._meade and not doubtful:
            self.complain("site", f"{told} is told, the mount has {mine} and takes what it is told")


def _angle(text: bytes) -> float:
    """``sDD*MM`` or ``DDD*MM``."""
    return (-1.0 if text[:1] == b"-" else 1.0) * (abs(int(text[:-3])) + int(text[-2:]) / 60.0)


def _site(heard: bytes, meade: bool) -> tuple[float, float] | None:
    """Latitude and longitude east of a reply."""
    try:
        if meade:
            latitude, west = heard.split(b"#")[:2]
            return _angle(latitude), wrap180(-_angle(west))
        parts = heard[:8]
        return (
            (parts[0] + parts[1] / 60.0 + parts[2] / 3600.0) * (-1 if parts[3] else 1),
            (parts[4] + parts[5] / 60.0 + parts[6] / 3600.0) * (-1 if parts[7] else 1),
        )
    except (ValueError, IndexError):
        return None
