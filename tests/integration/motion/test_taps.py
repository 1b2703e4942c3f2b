"""Taps on an arrow: each moves the mount by its own length, whatever the line and the protocol, and none is refused."""

from __future__ import annotations

import asyncio

import pytest

from gateway.astro.spherical import SIDEREAL_ARCSEC_PER_S
from gateway.core import operations as op
from gateway.diagnostics.rehearsal.stage import RehearsalClient, RehearsalGateway
from gateway.diagnostics.virtual_time import run
from tests.support.sampling import as_a_rule
from tests.support.taps import FACES, LATENCIES, LENGTHS, MOUNTS, Axes, at_keypad, judged, stage, tap
from tests.support.truth import moving

FIRST, SECOND = "127.0.0.1", "10.0.0.9"


@pytest.mark.parametrize("face", FACES)
@pytest.mark.parametrize("mount", MOUNTS)
def test_short_press_moves_as_far_as_one_at_the_keypad(mount: str, face: str) -> None:
    grid = [(latency, seconds) for latency in LATENCIES for seconds in LENGTHS]
    for latency, seconds in grid[:: as_a_rule(4, whole=1)]:
        assert not (why := run(judged(face, mount, seconds, latency))), (latency, seconds, why)


def refusals(own: RehearsalGateway) -> list[str]:
    return [notice.text for notice in own.controller.wire_log.recent_notices]


@pytest.mark.parametrize("latency", [0.0, 0.02, 0.05])
@pytest.mark.parametrize("face", ["lx200", "nexstar"])
async def test_every_short_press_of_a_series_moves_the_mount(face: str, latency: float) -> None:
    """Three north, one south, and the next one begins before the one before has ended."""
    single = abs((await tap(face, "cpc", 0.12, latency)).moved)
    async with stage(face, "cpc", latency) as own:
        one, axes, client = FACES[face], Axes(own), own.client()
        client.send(one.before)
        await asyncio.sleep(1.0)
        await axes.begin()
        for press in (one.press, one.press, one.opposite, one.press):
            client.send(press)
            await asyncio.sleep(0.12)
            client.send(one.release)
            await asyncio.sleep(0.13)
        await asyncio.sleep(3.0)
        assert refusals(own) == []
        assert abs(abs(axes.moved) - 2.0 * single) <= 4.0 * latency / 2.0 + 0.001
        assert not moving(own.sim)


@pytest.mark.parametrize("latency", [0.1, 0.15, 0.3])
@pytest.mark.parametrize("face", ["lx200", "nexstar"])
async def test_repeated_short_presses_add_up_on_a_slow_line(face: str, latency: float) -> None:
    keypad = await at_keypad("cpc", 0.12, 1.0)
    async with stage(face, "cpc", latency) as own:
        one, axes, client = FACES[face], Axes(own), own.client()
        client.send(one.before)
        await asyncio.sleep(1.0)
        await axes.begin()
        for _ in range(5):
            client.send(one.press)
            await asyncio.sleep(0.12)
            client.send(one.release)
            await asyncio.sleep(0.13)
        await asyncio.sleep(3.0)
        assert refusals(own) == []
        assert 2.5 * keypad <= abs(axes.moved) <= 5.0 * (keypad + 0.1 + 2.0 * latency)
        assert not moving(own.sim)


@pytest.mark.parametrize(
    "end", [b":Q#", b":Qe#:Qw#:Qn#:Qs#", b":Qn#:Qs#:Qe#:Qw#", ":Mn# of another", ":Qn# of another"]
)
@pytest.mark.parametrize("tapped", [True, False])
async def test_stop_cancels_a_pending_short_press(end: bytes | str, tapped: bool) -> None:
    async with stage("lx200", "cpc", 0.3) as own:
        axes, client, other = Axes(own), own.client(FIRST), own.client(SECOND)
        client.send(b":RM#")
        await asyncio.sleep(1.0)
        await axes.begin()
        client.send(b":Mn#")
        await asyncio.sleep(0.1)
        if tapped:
            client.send(b":Qn#")
            await asyncio.sleep(0.02)
        if isinstance(end, bytes):
            client.send(end)
        else:
            other.send(b":Qn#" if end.startswith(":Q") else b":Q#")
        await asyncio.sleep(3.0)
        assert abs(axes.moved) < 0.003
        assert not own.controller.wanted.hand_moves
        assert not any("Release" in text for text in refusals(own))


async def test_release_of_all_four_arrows_stops_the_mount() -> None:
    """RTS2 stops by the releases of all four arrows: each acts when it is read."""
    async with stage("lx200", "cpc", 0.1) as own:
        client = own.client()
        client.send(b":RM#:Mn#:Me#")
        await asyncio.sleep(2.0)
        assert moving(own.sim)
        for release in (b"#:Qe#", b"#:Qw#", b"#:Qn#", b"#:Qs#"):
            client.send(release)
            await asyncio.sleep(0.01)
        await asyncio.sleep(1.2)
        assert not moving(own.sim)


async def test_goto_cancels_a_pending_short_press() -> None:
    async with stage("lx200", "cpc", 0.3) as own:
        client = own.client()
        begun: list[op.Operation] = []
        own.controller.reconciler.acknowledged.connect(begun.append)
        here: op.Equatorial = await own.controller.read(op.Position())
        client.send(b":RM#:Me#")
        await asyncio.sleep(0.05)
        client.send(b":Mn#")
        await asyncio.sleep(0.05)
        client.send(b":Qn#")
        await own.controller.perform(op.Goto(here.ra, here.dec - 3.0))
        await asyncio.sleep(8.0)
        assert not any(isinstance(one, op.Move) and one.axis == 2 for one in begun)
        assert any(isinstance(one, op.Goto) for one in begun)


@pytest.mark.parametrize("times", [1, 3])
async def test_short_press_that_waited_too_long_is_dropped(times: int) -> None:
    """It was held for longer than a tap may wait, and the mount has not begun to move."""
    async with stage("lx200", "cgem", 0.6) as own:
        axes, client = Axes(own), own.client()
        client.send(b":RM#")
        await asyncio.sleep(2.0)
        await axes.begin()
        client.send(b":Mn#")
        await asyncio.sleep(1.1)
        client.send(b":Qn#" * times)
        await asyncio.sleep(5.0)
        assert abs(axes.moved) < 0.01
        assert ["this tap came too late" in words for words in refusals(own)] == [True]


async def test_short_press_behind_a_pending_read_still_moves_the_mount() -> None:
    async with stage("lx200", "cpc", 0.2) as own:
        axes, client = Axes(own), own.client()
        await asyncio.sleep(12.0)  # nothing is known of the mount any more
        await axes.begin()
        client.send(b":RM#:GW#:Mn#")
        await asyncio.sleep(0.1)
        client.send(b":Qn#")
        await asyncio.sleep(3.0)
        assert b"T" in client.received
        assert abs(axes.moved) > 0.03
        assert refusals(own) == []
        assert not moving(own.sim)


def test_short_press_that_begins_late_keeps_its_length() -> None:
    async def program(seconds: float) -> float:
        async with stage("lx200", "cpc", 0.05) as own:
            axes, client = Axes(own), own.client()
            client.send(b":RM#")
            await asyncio.sleep(1.0)
            await axes.begin()
            client.send(b":Mn#")
            await asyncio.sleep(seconds)
            assert 2 in own.controller.wanted.hand_moves
            client.send(b":Qn#")
            return await axes.rest(1.0)

    assert run(program(0.28)) > 0.3
    assert run(program(1.2)) <= 0.35


async def test_held_arrow_after_a_pending_short_press_runs_until_its_release() -> None:
    async with stage("lx200", "cpc", 0.24) as own:
        client = own.client()
        client.send(b":RM#:Mw#")
        await asyncio.sleep(0.08)
        client.send(b":Qw#")
        await asyncio.sleep(0.02)
        client.send(b":Me#")
        await asyncio.sleep(4.0)
        assert 1 in own.controller.wanted.hand_moves
        assert refusals(own) == []
        client.send(b":Qe#")
        await asyncio.sleep(1.5)
        assert not moving(own.sim)


async def test_short_press_sent_over_two_connections_moves_the_mount() -> None:
    async with stage("lx200", "cpc", 0.15) as own:
        axes = Axes(own)

        async def send(data: bytes) -> None:
            client: RehearsalClient = own.client(SECOND)
            client.send(data)
            await asyncio.sleep(0.02)
            client.close()

        await send(b":RM#")
        await asyncio.sleep(1.0)
        await axes.begin()
        await send(b":Mn#")
        await asyncio.sleep(0.08)
        await send(b":Qn#")
        await asyncio.sleep(3.0)
        assert abs(axes.moved) >= await at_keypad("cpc", 0.1, 1.0) / 2.0
        assert not moving(own.sim)


#: How a full stop follows a press, what was done before, and whether the arrow still moves the mount.
STOPS = {
    "a press just now": (b"", 0.1, True),
    "a press a while ago": (b"", 0.6, False),
    "another arrow moves": (b":Me#", 0.0, False),
}


@pytest.mark.parametrize("how", STOPS)
@pytest.mark.parametrize("known", [True, False])
async def test_full_stop_used_as_arrow_release_does_not_cancel_a_short_press(how: str, known: bool) -> None:
    before, seconds, taps = STOPS[how]
    async with stage("lx200", "cpc", 0.3) as own:
        axes, client = Axes(own), own.client()
        client.connection.client.arrow_releases.sends_stop_all = known
        client.send(b":RM#")
        await asyncio.sleep(1.0)
        await axes.begin()
        client.send(before)
        await asyncio.sleep(2.0)
        client.send(b":Mn#")
        await asyncio.sleep(seconds)
        stops = own.controller.stop_count
        client.send(b":Q#")
        assert own.controller.stop_count == stops + 1
        await asyncio.sleep(4.0)
        assert not moving(own.sim)
        assert not own.controller.wanted.hand_moves
        assert own.sent_requests().count(b"M") >= 1, "the stop is sent"
        if taps and known:
            assert 0.02 <= abs(axes.moved) <= 0.1 + 2.0 * 0.3
        else:
            assert abs(axes.moved) < 0.005


@pytest.mark.parametrize("presses", [b":Mn#:Qn#", b":Mn#:Mn#"])
async def test_full_stop_after_the_release_cancels_a_waiting_short_press(presses: bytes) -> None:
    async with stage("lx200", "cpc", 0.3) as own:
        axes, client = Axes(own), own.client()
        client.connection.client.arrow_releases.sends_stop_all = True
        client.send(b":RM#")
        await asyncio.sleep(1.0)
        await axes.begin()
        client.send(presses[:4])
        await asyncio.sleep(0.1)
        client.send(presses[4:] if b"Q" in presses else b":Q#")
        await asyncio.sleep(0.1)
        client.send(b":Q#")
        await asyncio.sleep(3.0)
        assert abs(axes.moved) < 0.005
        assert not moving(own.sim)


async def away_from_the_pole(client: RehearsalClient) -> None:
    """Move there, because the sense of north changes at the pole; then choose the guide rate."""
    client.send(b":RM#:Ms#")
    await asyncio.sleep(4.0)
    client.send(b":Qs#")
    await asyncio.sleep(4.0)
    client.send(b":RG#")


@pytest.mark.parametrize("latency", [0.05, 0.15, 0.3])
@pytest.mark.parametrize("mount", ["cgem", "lx200gps"])
def test_short_press_at_guide_rate_moves_for_exactly_its_length(mount: str, latency: float) -> None:
    rates: list[float] = []

    async def program(seconds: float) -> float:
        async with stage("lx200", mount, latency) as own:
            axes, client = Axes(own), own.client()
            await away_from_the_pole(client)
            rates.append(
                (own.driver.guide_rates[2] if mount == "cgem" else own.driver.guide_rate) * SIDEREAL_ARCSEC_PER_S
            )
            await axes.begin()
            client.send(b":Mn#")
            await asyncio.sleep(seconds)
            client.send(b":Qn#")
            await asyncio.sleep(3.0)
            assert refusals(own) == []
            assert not moving(own.sim)
            return abs(axes.moved) * 3600.0

    for seconds in (0.04, 0.12, 0.6, 0.95):
        moved = run(program(seconds))
        assert moved == pytest.approx(seconds * rates[-1], rel=0.1, abs=0.1), seconds


def test_short_presses_at_guide_rate_add_up_on_a_mount_without_pulses() -> None:
    """Each is shorter than an exchange, and none is lengthened to more than half as much again."""

    async def program(times: int) -> float:
        async with stage("lx200", "cge", 0.3) as own:
            axes, client = Axes(own), own.client()
            await away_from_the_pole(client)
            await axes.begin()
            for _ in range(times):
                client.send(b":Mn#")
                await asyncio.sleep(0.08)
                client.send(b":Qn#")
                await asyncio.sleep(1.0)
            await asyncio.sleep(3.0)
            assert refusals(own) == []
            return abs(axes.moved) * 3600.0

    assert run(program(1)) < 0.1
    assert run(program(6)) == pytest.approx(6 * 0.08 * 7.5, rel=0.5)
