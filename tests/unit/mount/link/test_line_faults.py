"""The line under faults: nothing is lost, nothing is told wrongly, and what comes back is not what went away."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from itertools import product
from random import Random
from typing import Any

import pytest

from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.core.errors import Fault, Garbled, NoAnswer
from gateway.core.wire_log import WireLog
from gateway.diagnostics.virtual_time import run
from gateway.mount.link.line import HALF_COMMAND_SILENCE, MountLink
from gateway.mount.link.queue import READ, STOP
from gateway.protocols.base.driver import Send
from gateway.protocols.lx200.reply_rules import Lx200ReplyRules
from gateway.protocols.nexstar.reply_rules import NexStarReplyRules
from gateway.transport.wires import SerialTransport
from tests.support.each import each
from tests.support.faulty_line import Kind
from tests.support.in_process_gateway import Bridge
from tests.support.line_faults import trial
from tests.support.sampling import as_a_rule
from tests.unit.mount.link.test_queue import Wire, hand_control, opened

EVERY = tuple(kind for kind in Kind if kind not in (Kind.MUTE, Kind.REBOOT))


# --- everything at once -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("driven", "model", "seed"), [("nexstar", "cge", 11), ("lx200", "autostar", 13)])
def test_reads_over_a_faulty_line_are_never_wrong(driven: str, model: str, seed: int) -> None:
    """A failure is played again by its seed. With ``--whole``, every kind of fault alone, too, at three rates."""
    kinds = as_a_rule([EVERY], whole=[EVERY, tuple(Kind), *((kind,) for kind in Kind)])
    for faults, rate in product(kinds, as_a_rule([0.05], whole=[0.01, 0.05, 0.2])):
        done = trial(driven, model, seed, rate, faults, as_a_rule(200, whole=2000))
        assert not done.wrong, (faults, rate, done.notes)
        if faults == EVERY:
            assert sum(done.wire.faults.values()) >= 5
            assert done.asked["positions"] > 50


# --- one fault at a time ------------------------------------------------------------------------------------------


async def test_mount_line_is_up_again_after_the_second_check() -> None:
    deaf = 2  # the question and the first echo

    def answers(data: bytes) -> list[tuple[float, bytes]]:
        nonlocal deaf
        deaf -= 1
        return [] if deaf >= 0 else hand_control(data)

    line, _ = await opened(answers)
    with pytest.raises(NoAnswer):
        await line.exchange(Send("J"))
    await asyncio.sleep(10)
    assert line.state == "up"
    assert (await line.exchange(Send("t")))["mode"] == 2
    await line.close()


@each("after", [0.0, 0.01, 0.03])
async def test_duplicate_reply_is_not_taken_for_the_next_one(after: float) -> None:
    replies = {b"e": b"10000000,20000000#", b"z": b"30000000,40000000#"}

    def answers(data: bytes) -> list[tuple[float, bytes]]:
        reply = replies.get(data)
        return hand_control(data) if reply is None else [(0.05, reply), (0.05 + after, reply)]

    line, wire = await opened(answers)
    wire.deliver(b"#")  # a line that has shown that it does such things
    first, second = [asyncio.ensure_future(line.exchange(Send(name))) for name in ("e", "z")]
    done = await asyncio.gather(first, second, return_exceptions=True)
    for outcome, field, value in zip(done, ("ra", "az"), (22.5, 67.5), strict=True):
        assert isinstance(outcome, Garbled) or outcome[field] == value  # type: ignore[index]
    await line.close()


async def test_doubled_acknowledgement_of_a_stop_is_rejected_as_garbled() -> None:
    line, _ = await opened(lambda data: [(0.01, b"#"), (0.02, b"#")] if data == b"M" else hand_control(data))
    with pytest.raises(Garbled):
        await line.exchange(Send("M"), STOP)
    assert (await line.exchange(Send("t")))["mode"] == 2
    await line.close()


@each("reply", [b"+45*30:15#", b"12:3x:56#", b"2:34:56#", b"1#"])
def test_malformed_right_ascension_reply_is_rejected(reply: bytes) -> None:
    """What a client may write and a declination are no right ascension."""
    outcome = Lx200ReplyRules().parse_reply(Send("GR"), reply)
    assert outcome is not None
    assert isinstance(outcome[0], Garbled)


async def test_line_stays_quiet_for_a_while_after_half_a_command() -> None:
    """The other half of a goto must not be made of what was meant to prove the line."""
    line, wire = await opened(hand_control)
    good, sent = wire.write, wire.sent

    def bad(data: bytes) -> None:
        sent.append(data[:4])
        raise OSError(5, "gone")

    wire.write = bad  # type: ignore[method-assign]
    with pytest.raises(NoAnswer):
        await line.exchange(Send("e"))
    wire.write = good  # type: ignore[method-assign]
    await asyncio.sleep(HALF_COMMAND_SILENCE - 0.1)
    assert len(sent) == 1
    await asyncio.sleep(2)
    assert line.state == "up"
    await line.close()


async def test_mute_port_is_reopened() -> None:
    """A network bridge that was restarted may leave a connection that nobody answers on."""
    wire = Wire(lambda data: hand_control(data) if wire.opened == 2 else [])
    line = MountLink(wire, NexStarReplyRules(), WireLog(lambda: 0.0))
    line.start()
    await asyncio.sleep(0.01)
    with pytest.raises(NoAnswer):
        await line.exchange(Send("J"))
    await asyncio.sleep(60)
    assert wire.opened == 2
    assert line.state == "up"
    await line.close()


class _Port:
    """A serial port whose driver fails in its own way."""

    in_waiting = 0

    def read(self, count: int) -> bytes:
        raise RuntimeError("a driver's own idea of an error")

    def write(self, data: bytes) -> int:
        return len(data) - 1

    def close(self) -> None:
        pass


@pytest.mark.real_time
async def test_dead_reader_is_reported_and_a_partial_write_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gateway.transport.wires.open_port", lambda url, baud: _Port())
    wire, lost = SerialTransport("/dev/none"), asyncio.Event()
    await wire.open(lambda data: None, lambda reason: lost.set())
    async with asyncio.timeout(60):
        await lost.wait()
    with pytest.raises(OSError, match="only 1 of 2"):
        wire.write(b"Kx")
    await wire.close()


# --- what clients see ---------------------------------------------------------------------------------------------


def silence(bridge: Bridge) -> Callable[[], None]:
    """The mount says nothing until what is returned is called."""
    wire: Any = bridge.controller.line.wire
    good = wire.feed
    wire.feed = lambda data: b""

    def heal() -> None:
        wire.feed = good

    return heal


async def test_clients_get_failures_while_the_line_is_down() -> None:
    async with Bridge() as bridge:
        client = bridge.client()
        position = await client.ask(b":GR#")
        silence(bridge)
        await asyncio.sleep(1)
        bridge.client("10.0.0.2").send(b":GR#")
        await asyncio.sleep(8)
        assert bridge.controller.line.state == "down"
        assert await client.ask(b":GR#", 0.1) == position
        assert await client.ask(b":Sr05:00:00#", 0.1) == b"1"
        assert await client.ask(b":Sd+30*00:00#", 0.1) == b"1"
        assert await client.ask(b":MS#", 0.1, ending=b"#") == b"1No answer from mount.#"
        await asyncio.sleep(5)
        assert await client.ask(b":GR#", 1.0) == b""


async def test_hand_control_restart_is_noticed_by_its_lost_alignment_and_tracking() -> None:
    async with Bridge("cge") as bridge:
        client = bridge.client()
        assert await client.ask(b":GW#") == b"PT1"
        heal = silence(bridge)
        client.send(b":GR#")
        await asyncio.sleep(10)
        bridge.sim.aligned = False
        bridge.sim.track(0)
        heal()
        await asyncio.sleep(5)
        assert await client.ask(b":GW#") == b"PN0"
        assert (await client.ask(b":Sr05:00:00#:Sd+60*00:00#:MS#", ending=b"#")).startswith(b"111")


async def test_meade_switched_off_and_on_is_set_to_high_precision_again() -> None:
    async with Bridge("autostar", driven="lx200", presented="nexstar", surface="6-8se") as bridge:
        assert bridge.sim.high_precision
        bridge.sim.high_precision = False  # off and on between two questions
        await bridge.client().ask(b"e")
        await asyncio.sleep(1)
        assert bridge.sim.high_precision


@pytest.mark.parametrize("moves", [False, True])
def test_line_that_often_corrupts_a_digit_seldom_gives_a_wrong_position(moves: bool) -> None:
    """The first digit of 30 % of the positions is 0: a quarter turn away, which no motor makes between two replies."""

    async def program() -> None:
        async with Bridge("cpc", config={"sun": 0.0}) as bridge:
            random, wire, client = Random(4), bridge.controller.line.wire, bridge.client()
            await bridge.controller.perform(op.Goto(120.0, 30.0))
            while await bridge.controller.read_now(op.Slewing()):
                await asyncio.sleep(0.5)
            good = wire.feed  # type: ignore[attr-defined]

            def feed(data: bytes) -> bytes:
                reply: bytes = good(data)
                return b"0" + reply[1:] if data == b"e" and random.random() < 0.3 else reply

            wire.feed = feed  # type: ignore[attr-defined]
            wrong = told = 0
            for number in range(300):
                if moves and number % 20 == 0:
                    client.send(b":RM#:Mn#" if number % 40 else b":RM#:Ms#")
                with contextlib.suppress(Fault):
                    here = await bridge.controller.read_now(op.Position())
                    told += 1
                    wrong += (
                        separation(here.ra, here.dec, *bridge.sim.mechanics.believed_position(bridge.clock())) > 10.0
                    )
                await asyncio.sleep(0.1)
            assert told > 250 and wrong <= 6, (told, wrong)

    run(program())


async def test_lost_acknowledgement_of_a_goto_does_not_hide_the_slew() -> None:
    async with Bridge("autostar", driven="lx200", presented="nexstar", surface="6-8se") as bridge:
        wire: Any = bridge.controller.line.wire
        good = wire.feed
        wire.feed = lambda data: (good(data), b"")[1] if data == b":MS#" else good(data)
        client = bridge.client()
        await client.ask(b"r60000000,20000000")
        await asyncio.sleep(6)
        assert bridge.sim.slewing
        assert await client.ask(b"L") == b"1#"


async def test_unchanged_mount_reply_is_not_read_twice() -> None:
    """Steady answers cost one exchange each."""
    async with Bridge("cge") as bridge:
        await bridge.controller.verifier.exchange(Send("t"), READ)
        before = len(bridge.sent_requests())
        for _ in range(5):
            await bridge.controller.verifier.exchange(Send("t"), READ)
        assert bridge.sent_requests()[before:].count(b"t") == 5
