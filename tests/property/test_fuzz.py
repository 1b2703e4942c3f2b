"""Random bytes at both ends of a gateway, a little of it every time, and what larger runs have found."""

from __future__ import annotations

import asyncio
from random import Random

import pytest

from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.diagnostics.virtual_time import run
from gateway.mount.link.queue import READ
from gateway.mount.motion.seen import ObservedMotion, PositionSample
from gateway.protocols.lx200.simulator.server import SimulatedLx200
from tests.support.each import each
from tests.support.fuzz_bytes import KINDS
from tests.support.fuzz_drivers import Findings, corrupt, mounts
from tests.support.fuzz_forms import PROTOCOLS, of_reply, of_request
from tests.support.fuzz_surfaces import LONGEST, Judge, cases, growth, throw
from tests.support.in_process_gateway import EVENING, Bridge
from tests.support.sampling import WHOLE, as_a_rule

CASES = {str(case): case for case in cases()}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "case", as_a_rule(["lx200:autostar on nexstar:6-8se", "nexstar:cge 4.21 on lx200:autostar"], whole=[*CASES])
)
def test_surface_still_answers_after_random_bytes(case: str, kind: str) -> None:
    judge = Judge(CASES[case])
    size = as_a_rule(800, whole=200_000)
    done, longest = run(throw(CASES[case], kind, Random(f"{case} {kind}"), size, judge))
    assert done >= size
    assert not judge.first
    assert longest < LONGEST


@pytest.mark.skipif(not WHOLE, reason="it takes minutes; pytest --whole runs it")
def test_surface_keeps_no_memory_of_a_programs_bytes() -> None:
    assert {case: kept for case, kept in growth(seed=1).items() if kept > 0.5} == {}


@pytest.mark.parametrize(
    ("mount", "seed"),
    as_a_rule([("lx200:lx200gps", 6), ("nexstar:cpc", 8)], whole=[(":".join(mount), 6) for mount in mounts()]),
)
def test_driver_survives_corrupted_replies_of_a_mount(mount: str, seed: int) -> None:
    findings = Findings()
    size = as_a_rule(800, whole=100_000)
    assert run(corrupt(*mount.split(":"), Random(seed), size, findings)) >= size
    assert not findings.found
    assert findings.ended["value"]


def test_fuzz_checker_tells_malformed_replies_from_valid_ones() -> None:
    lx200, nexstar = PROTOCOLS["lx200"], PROTOCOLS["nexstar"]
    assert not of_reply(lx200, b":GR#", b"12:34:56#")
    assert not of_reply(nexstar, b"V", b"\x04\x15#")
    assert not of_reply(nexstar, b"P\1\xb0\x37\0\0\0\1", b"\0\0#"), "the no-response form"
    assert not of_request(nexstar, b"P\2\x10\x24\0\0\0\0")
    for frame, reply in ((b":GR#", b"24:00:00#"), (b":GR#", b"12:34:56##"), (b":GD#", b"+9\xff*00#"), (b":Mn#", b"1")):
        assert of_reply(lx200, frame, reply)
    for frame, reply in ((b"V", b"\x04\x15"), (b"e", b"12AB,4000#"), (b"Q", b"#")):
        assert of_reply(nexstar, frame, reply)
    assert of_request(lx200, b":GR") and of_request(lx200, b":Sr99:00:00#") and of_request(nexstar, b"P\2\x10")


# --- what was found ---------------------------------------------------------------------------------------------------


def _mute(bridge: Bridge) -> None:
    bridge.controller.line.wire.feed = lambda data: b""  # type: ignore[attr-defined]


async def test_read_from_an_unidentified_mount_ends_after_a_stop() -> None:
    bridge = Bridge()
    _mute(bridge)
    bridge.controller.start()
    with pytest.raises(Fault):
        await bridge.controller.stop()
    bridge.controller.cache.put(op.Slewing, False, bridge.controller.now())  # as an acknowledged stop leaves it
    await asyncio.sleep(20)
    async with asyncio.timeout(60):
        with pytest.raises(Fault):
            await bridge.controller.read(op.Slewing())
    await bridge.controller.close()


def test_mount_line_is_up_again_after_two_lost_replies() -> None:
    async def program() -> None:
        async with Bridge() as bridge:
            good, lost = bridge.controller.line.wire.feed, [2]  # type: ignore[attr-defined]

            def feed(data: bytes) -> bytes:
                lost[0] -= 1
                return b"" if lost[0] >= 0 else bytes(good(data))

            bridge.controller.line.wire.feed = feed  # type: ignore[attr-defined]
            with pytest.raises(Fault):
                await bridge.controller.reader._runner.drive(bridge.driver.perform(op.GetSite()), READ)
            await asyncio.sleep(60)
            assert bridge.controller.line.state == "up"

    run(program())


async def test_failed_stop_that_nobody_awaits_raises_no_unhandled_exception() -> None:
    left: list[object] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: left.append(context))
    async with Bridge() as bridge:
        _mute(bridge)
        waiting = asyncio.create_task(bridge.controller.stop())
        await asyncio.sleep(1)
        waiting.cancel()
        await asyncio.sleep(60)
    assert not left


@pytest.mark.parametrize("date", ["12/31/9999", "01/01/0001", "01/01/1950", "01/01/2051"])
async def test_year_that_two_digits_cannot_express_is_refused(date: str) -> None:
    async with Bridge(aligned=False) as bridge:
        client = bridge.client()
        assert await client.ask(b":SG-14.0#") + await client.ask(b":SL20:00:00#") == b"11"
        assert await client.ask(b":SC" + date.encode() + b"#") == b"0"
        await asyncio.sleep(5)
        assert await client.ask(b":GC#") == b"01/16/26#"
    assert not [entry.note for entry in bridge.entries if "internal error" in entry.note]


async def test_lx200_date_accepts_a_four_digit_year() -> None:
    async with Bridge(aligned=False) as bridge:
        client = bridge.client()
        assert (await client.ask(b":SC12/31/2050#")).startswith(b"1")
        await asyncio.sleep(5)
        assert await client.ask(b":GC#") == b"12/31/50#"


@each(("zone", "dst"), [(127, 0), (1, 3), (200, 0)])
async def test_impossible_time_zone_of_a_hand_control_is_not_reported(zone: int, dst: int) -> None:
    bridge = Bridge()
    good = bridge.controller.line.wire.feed  # type: ignore[attr-defined]
    bridge.controller.line.wire.feed = lambda data: (  # type: ignore[attr-defined]
        bytes((12, 0, 0, 1, 15, 26, zone, dst)) + b"#" if data in (b"h", b"i") else good(data)
    )
    async with bridge:
        assert bridge.site_clock.mount_clock is None
        moment = await bridge.controller.answer(op.GetClock())
        assert moment.offset == 0.0


async def test_internal_error_in_a_delayed_clock_set_is_logged() -> None:
    left: list[object] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, context: left.append(context))
    async with Bridge(aligned=False) as bridge:

        def broken(*_: object) -> None:
            raise ArithmeticError("as if")

        surface = bridge.acceptor.binding.surface
        surface.handlers = {**surface.handlers, "clock.commit_draft_after_pause": lambda *_: (broken() for _ in "x")}
        client = bridge.client()
        await client.ask(b":SL20:15:30#")
        await asyncio.sleep(5)
        assert await client.ask(b":GR#")
    assert [entry for entry in bridge.entries if "internal error at clock.commit_draft_after_pause" in entry.note]
    assert not left


def test_simulated_classic_lx200_shows_distance_bars_in_a_goto_with_only_ra_set() -> None:
    now = [EVENING]
    sim = SimulatedLx200("lx200", clock=lambda: now[0], site=(45.0, 10.0))
    sim.feed(b":Sr02:00:00#:MS#")
    now[0] += 1.0
    assert sim.feed(b":D#").startswith(b"\xff")


async def test_position_read_before_the_site_was_known_is_checked_against_the_sun_later() -> None:
    async with Bridge(start=EVENING - 10 * 3600.0) as bridge:
        guard = bridge.controller.watch
        seen = await bridge.controller.read(op.Position())
        guard.observed = ObservedMotion(last=PositionSample(bridge.controller.now() - 1.0, seen))
        guard._coasts_until = 0.0
        assert bridge.controller.suns.distances(seen)
        guard.check_position(seen)
        assert guard.observed.farthest_from_suns
