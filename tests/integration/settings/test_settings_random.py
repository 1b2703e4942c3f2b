"""Settings at any moments, over a line with any faults: in the end the mount has what reads tell, and that is the last.

Or, where it was given up after three times, reads tell what the mount has, and the log says so.
"""

from __future__ import annotations

import asyncio
from datetime import UTC, datetime
from random import Random
from typing import Any

import pytest

from gateway.core.operations import Backlash, Moment, Place, SetClock, SetSite
from gateway.mount.site.pending_settings import (
    TRIES,
    Pending,
    Setting,
    add,
    after_attempt,
    clock_matches_sent,
    next_setting,
    site_matches_sent,
    with_postponed,
    without_setting,
)
from tests.support.cable import Cable, lose_commands, lose_replies
from tests.support.in_process_gateway import Bridge
from tests.support.sampling import as_a_rule

SITES = [
    (b"+40*45", b"074*30", (40.75, -74.5)),
    (b"-33*52", b"208*48", (-33.867, 151.2)),
    (b"+60*10", b"335*03", (60.167, 24.95)),
]
LOSABLE = {"lx200": (b":St", b":Sg", b":SG", b":SL", b":SC", b":Gt", b":GL"), "nexstar": (b"W", b"H", b"h", b"w")}
SOON, LONG = 8.0, 45.0


class Night:
    """What a program has set last; everything else is the line's."""

    def __init__(self, bridge: Any, seed: int, driven: str) -> None:
        self.bridge, self.random, self.driven = bridge, Random(seed), driven
        self.client, self.cable = bridge.client(), Cable(bridge)
        self.site: tuple[float, float] | None = None
        self.clock: float | None = None

    async def step(self) -> None:
        what = self.random.choice(["site", "clock", "site", "clock", "half", "cut", "lost", "unheard"])
        if what in ("site", "half"):
            latitude, longitude, place = self.random.choice(SITES)
            self.client.send(b":St%s#" % latitude)
            if what == "half":
                await asyncio.sleep(self.random.uniform(0.0, 1.9))
            self.client.send(b":Sg%s#" % longitude)
            self.site = place
        elif what == "clock":
            wanted = datetime.fromtimestamp(self.bridge.clock() + self.random.uniform(-3e7, 3e7), UTC)
            offset = self.random.randint(-11, 12)
            self.client.send(f":SG{-offset:+03d}#:SL{wanted:%H:%M:%S}#:SC{wanted:%m/%d/%y}#".encode())
            self.clock = wanted.replace(microsecond=0).timestamp() - offset * 3600.0 - self.bridge.clock()
        elif what == "cut":
            self.cable.pull()
            await asyncio.sleep(self.random.uniform(0.1, SOON))
            self.cable.plug()
        else:
            lose = lose_commands if what == "lost" else lose_replies
            lose(self.bridge, (self.random.choice(LOSABLE[self.driven]),), 1)
        await asyncio.sleep(self.random.choice([0.0, 0.05, 0.5, 2.5, 6.0, 15.0]))

    async def quiet(self) -> None:
        for _ in range(round(LONG)):
            self.client.send(b":GR#")
            await asyncio.sleep(1.0)

    def judge(self) -> None:
        sim, said = self.bridge.sim, [entry.note for entry in self.bridge.entries if "not in force" in entry.note]
        assert not said
        assert not self.bridge.controller.site_settings.sender.pending
        sim.true_position()
        here = sim.site if self.driven == "lx200" else sim.mechanics.sky[:2]
        if self.site is not None:
            assert here == pytest.approx(self.site, abs=0.02)
        if self.clock is not None:
            assert sim.utc() == pytest.approx(self.bridge.clock() + self.clock, abs=3.0)
        told = self.bridge.controller.sources
        assert (told.site().latitude, told.site().longitude) == pytest.approx(here, abs=0.02)
        assert told.unix() == pytest.approx(sim.utc(), abs=3.0)


@pytest.mark.parametrize(
    ("mount", "driven"),
    [("lx200", "lx200"), ("autostar", "lx200"), ("lx200gps", "lx200"), ("6-8se", "nexstar"), ("avx", "nexstar")],
)
@pytest.mark.parametrize("seed", range(as_a_rule(6, whole=12)))
async def test_mount_ends_with_the_last_settings_after_any_faults(mount: str, driven: str, seed: int) -> None:
    config = {"lowest": -90.0, "sun": 0.0}
    async with Bridge(mount, driven=driven, aligned=driven == "lx200", surface="autostar", config=config) as bridge:
        night = Night(bridge, seed, driven)
        for _ in range(8):
            await night.step()
        await night.quiet()
        night.judge()


# --- the pure part --------------------------------------------------------------------------------------------------

HERE, THERE = SetSite(1.0, 2.0), SetSite(3.0, 4.0)


def test_newest_setting_of_a_kind_is_sent_and_the_clock_last() -> None:
    pending: Pending = {}
    for value in (SetClock(0.0, 0.0), HERE, Backlash(1, 5), Backlash(2, 6), THERE):
        pending = add(pending, Setting(value, requested_at=float(len(pending))))
    told = []
    while isinstance(step := next_setting(pending, 10.0), Setting):
        told.append(step.value)
        pending = without_setting(pending, step)
    assert told == [Backlash(1, 5), Backlash(2, 6), THERE, SetClock(0.0, 0.0)]
    assert step is None


def test_setting_that_fails_is_sent_three_times_at_growing_intervals() -> None:
    pending, now, times = add({}, Setting(HERE, requested_at=0.0)), 0.0, []
    while (step := next_setting(pending, now)) is not None:
        if isinstance(step, Setting):
            times.append(now)
            pending = after_attempt(pending, step, now)
        else:
            now = step
    assert len(times) == TRIES
    assert times == [0.0, 2.0, 7.0]


def test_postponing_a_setting_uses_up_none_of_its_tries() -> None:
    pending = add({}, Setting(HERE, requested_at=0.0))
    for now in range(100):
        step = next_setting(pending, float(now))
        if isinstance(step, Setting):
            assert step.tries_left == TRIES
            pending = with_postponed(pending, step, now + 2.0)


def test_finishing_an_older_setting_keeps_the_newer_one_pending() -> None:
    older, newer = Setting(HERE, requested_at=0.0, tries_left=1), Setting(THERE, requested_at=1.0)
    pending = add(add({}, older), newer)
    assert (
        without_setting(pending, older)
        == after_attempt(pending, older, 5.0)
        == with_postponed(pending, older, 5.0)
        == pending
    )


def test_received_half_of_a_site_is_not_taken_for_a_change_at_the_keys() -> None:
    sent = [Setting(SetSite(3.0, 179.9), requested_at=0.0)]
    before = Place(1.0, 2.0)
    for told, ours in (
        (Place(3.0, 2.0), True),
        (Place(1.0, 179.9 - 360.0), True),
        (Place(3.0, 179.9), True),
        (Place(1.0, 2.0), True),
        (Place(5.0, 2.0), False),
        (Place(3.0, 50.0), False),
    ):
        assert site_matches_sent(sent, before, told) is ours
    assert not site_matches_sent([], before, Place(1.0, 2.0))  # nothing was sent
    older = Setting(SetSite(7.0, 8.0), requested_at=0.0)
    assert site_matches_sent([older, *sent], before, Place(7.0, 179.9))


def test_zone_time_or_date_alone_is_not_taken_for_a_change_at_the_keys() -> None:
    sent = [Setting(SetClock(1e6 + 125.0, 5.5), requested_at=100.0)]
    before = Moment(2e6, 0.0)
    for told, ours in (
        (2e6, True),
        (2e6 - 5.5 * 3600.0, True),
        (1e6 + 135.0, True),
        (1e6 + 135.0 + 86400.0, True),
        (2e6 + 300.0, False),
        (1e6 + 900.0, False),
    ):
        assert clock_matches_sent(sent, before, Moment(told, 0.0), 110.0) is ours
