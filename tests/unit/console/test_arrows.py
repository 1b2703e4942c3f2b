"""Arrows on the page: its own scripts over a slow network, the gateway's sessions, and the true axes of the mount."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from contextlib import AsyncExitStack, asynccontextmanager
from random import Random

import pytest

from gateway.app.gateway import Gateway
from gateway.console.mounts import Mounts
from gateway.console.page_session import PageSession
from gateway.core import operations as op
from gateway.diagnostics.rehearsal.stage import RehearsalGateway
from gateway.diagnostics.virtual_time import run
from tests.support.console.browser import Node, Page, node
from tests.support.console.plays import DELAYS, JITTERS, play
from tests.support.sampling import as_a_rule
from tests.support.taps import LATENCIES, LENGTHS, Axes, at_keypad, stage
from tests.support.truth import moving

#: Seconds within which a page whose network is frozen moves nothing any more.
FROZEN = 2.2


@pytest.fixture(scope="module")
def scripts() -> Iterator[Node]:
    """One process for all pages: starting it takes longer than a test."""
    with node() as process:
        yield process


@pytest.fixture(autouse=True)
def named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Gateway, "names", lambda self: ["lx200@tcp://127.0.0.1:4030"])  # it has no port to tell of


@asynccontextmanager
async def opened(
    scripts: Node, delay: float = 0.0, mount: str = "cpc", latency: float = 0.1, pages: int = 1
) -> AsyncIterator[tuple[RehearsalGateway, list[Page]]]:
    async with AsyncExitStack() as stack:
        own = await stack.enter_async_context(stage("lx200", mount, latency))
        mounts = Mounts([own.gateway])
        shown = [Page(scripts, number, mounts, delay, 0.0, Random(number)) for number in range(pages)]
        for page in shown:
            await stack.enter_async_context(page)
        await asyncio.sleep(3.0 * delay + 1.0)
        for page in shown:
            page.do("rate", 7)
        yield own, shown


def refusals(own: RehearsalGateway) -> list[str]:
    return [notice.text for notice in own.controller.wire_log.recent_notices if "console" in notice.side]


def test_short_press_on_the_page_moves_as_far_as_on_the_keypad(scripts: Node) -> None:
    """As the taps of programs do, which ``integration/motion/test_taps.py`` tries on every mount."""
    mount = "cpc"

    async def program(latency: float, seconds: float) -> None:
        async with opened(scripts, 0.0, mount, latency) as (own, [page]):
            speeds: list[float] = []
            own.controller.reconciler.acknowledged.connect(
                lambda one: speeds.append(own.driver.speed(one.rate)) if isinstance(one, op.Move) else None
            )
            axes = Axes(own)
            await axes.begin()
            page.press("north")
            await asyncio.sleep(seconds)
            page.lift()
            await asyncio.sleep(latency * 5.0 + 1.0)
            await axes.rest(3.0)
            keypad = await at_keypad(mount, seconds, speeds[0])
            assert keypad / 2.0 <= abs(axes.moved) <= keypad + speeds[0] * (0.1 + 2.0 * latency), (latency, seconds)
            assert page.words == [] and refusals(own) == []

    grid = [(latency, seconds) for latency in LATENCIES for seconds in LENGTHS]
    for latency, seconds in grid[:: as_a_rule(5, whole=1)]:
        run(program(latency, seconds))


@pytest.mark.parametrize("delay", [0.0, *DELAYS])
@pytest.mark.parametrize("gap", [0.1, 0.2])
async def test_arrow_pressed_twice_quickly_on_the_page_stops_on_release(
    scripts: Node, delay: float, gap: float
) -> None:
    """A tap, and before its answer has come the same arrow is pressed again, held, and let go."""
    async with opened(scripts, delay) as (own, [page]):
        page.press("north")
        await asyncio.sleep(0.08)
        page.lift()
        await asyncio.sleep(gap)
        page.press("north")
        await asyncio.sleep(3.0)
        assert moving(own.sim)
        page.lift()
        await asyncio.sleep(delay + 1.0)
        assert not moving(own.sim)
        assert page.words == [] and refusals(own) == []


def test_random_arrow_presses_on_pages_leave_no_mount_moving(scripts: Node) -> None:
    moved = 0.0
    for seed in range(as_a_rule(2, whole=60)):
        delay, jitter = DELAYS[seed % len(DELAYS)], JITTERS[seed % len(JITTERS)]
        outcome = run(play(scripts, seed, delay, jitter))
        assert not outcome.run_away, (seed, outcome)
        moved += outcome.moved
    assert moved > 5.0


def test_arrow_of_a_page_ends_if_another_page_fails_to_continue_it(scripts: Node) -> None:
    """A page that still holds the arrow of another one may be refused to go on with it: the mount is slow to answer."""
    outcome = run(play(scripts, 85, 0.05, 0.5, "cpc", 0.3))
    assert not outcome.run_away and outcome.moved > 1.0, outcome


async def test_arrow_of_the_page_ends_when_its_network_freezes(scripts: Node) -> None:
    async with opened(scripts) as (own, [page]):
        page.press("north")
        await asyncio.sleep(2.0)
        page.freeze()
        began = asyncio.get_running_loop().time()
        while moving(own.sim):
            await asyncio.sleep(0.05)
        assert asyncio.get_running_loop().time() - began <= FROZEN + 0.1


@pytest.mark.parametrize("first_releases", [True, False])
async def test_release_on_one_page_leaves_the_arrow_of_another_alone(scripts: Node, first_releases: bool) -> None:
    """Both hold the same arrow; whoever lets go, the other still holds it."""
    async with opened(scripts, pages=2) as (own, pages):
        for page in pages:
            page.press("east")
            await asyncio.sleep(1.5)
        one, other = pages if first_releases else reversed(pages)
        one.lift()
        await asyncio.sleep(2.0)
        assert moving(own.sim)
        assert 1 in own.controller.wanted.hand_moves
        other.lift()
        await asyncio.sleep(1.2)
        assert not moving(own.sim)
        assert [*one.words, *other.words] == []


@pytest.mark.parametrize("end", [b":Q#", b":Sr02:00:00#:Sd+40*00:00#:MS#"])
async def test_stopped_arrow_does_not_restart_while_the_finger_stays_on_it(scripts: Node, end: bytes) -> None:
    """A stop or a goto of another program: neither another rate nor the release of a second page begins a motion."""
    async with opened(scripts, pages=2) as (own, [page, other]):
        page.press("north")
        other.press("north")
        await asyncio.sleep(2.0)
        own.client("10.0.0.1").send(end)
        await asyncio.sleep(1.5)
        page.do("rate", 9)
        other.lift()
        await asyncio.sleep(8.0)
        assert not own.controller.wanted.hand_moves
        page.press("south", 2)  # a new press counts
        await asyncio.sleep(3.0)
        assert own.controller.wanted.hand_moves


async def test_rate_changed_while_an_arrow_is_held_is_applied(scripts: Node) -> None:
    async with opened(scripts, 0.15) as (own, [page]):
        page.press("north")
        await asyncio.sleep(1.5)
        page.do("rate", 9)
        await asyncio.sleep(1.5)
        [motion] = own.controller.wanted.hand_moves.values()
        assert motion.rate.key == 9
        page.lift()
        await asyncio.sleep(1.5)
        assert not moving(own.sim)


class _Nobody:
    def unread_byte_count(self) -> int:
        return 0

    async def send(self, text: str) -> None:
        """Drop what the page is sent."""


async def test_page_heartbeat_stops_an_arrow_missing_from_its_list() -> None:
    async with stage("lx200", "cpc", 0.1) as own:
        session = PageSession(Mounts([own.gateway]), _Nobody(), "10.0.0.9", may_control=True)
        session.receive('{"do":"jog","direction":"north","rate":7,"press":1}')
        session.receive('{"do":"jog","direction":"east","rate":7,"press":2}')
        await asyncio.sleep(2.0)
        assert own.controller.wanted.axes_moved_by_hand == {1, 2}
        session.receive('{"do":"beat","held":[{"mount":0,"direction":"east","press":2}]}')
        await asyncio.sleep(0.5)
        assert own.controller.wanted.axes_moved_by_hand == {1}
        session.receive('{"do":"beat","held":[{"mount":0,"direction":"east","press":1}]}')
        await asyncio.sleep(0.5)
        assert not own.controller.wanted.axes_moved_by_hand
        session.receive('{"do":"jog","direction":"east","rate":7,"press":2}')  # an old one
        await asyncio.sleep(1.0)
        assert not own.controller.wanted.axes_moved_by_hand


async def test_page_heartbeat_leaves_a_short_arrow_press_alone() -> None:
    async with stage("lx200", "cpc", 0.3) as own:
        axes = Axes(own)
        await axes.begin()
        session = PageSession(Mounts([own.gateway]), _Nobody(), "10.0.0.9", may_control=True)
        session.receive('{"do":"jog","direction":"north","rate":7,"press":1}')
        await asyncio.sleep(0.1)
        session.receive('{"do":"let_go","direction":"north","press":1}')
        session.receive('{"do":"beat","held":[]}')
        await asyncio.sleep(3.0)
        assert abs(axes.moved) > 0.02
        assert not moving(own.sim)


async def test_closed_page_cancels_an_unsent_arrow_press() -> None:
    async with stage("lx200", "cpc", 0.3) as own:
        axes = Axes(own)
        await axes.begin()
        session = PageSession(Mounts([own.gateway]), _Nobody(), "10.0.0.9", may_control=True)
        shown = asyncio.ensure_future(session.run())
        await asyncio.sleep(0.0)
        session.receive('{"do":"jog","direction":"north","rate":7,"press":1}')
        await asyncio.sleep(0.1)
        shown.cancel()
        await asyncio.sleep(3.0)
        assert abs(axes.moved) < 0.003
        assert not own.controller.wanted.hand_moves
