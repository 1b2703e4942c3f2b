"""A command that lost its ``#``, through a whole gateway and in the simulators; what a refused catalogue leaves."""

from __future__ import annotations

import asyncio

import pytest

from tests.support.fake_mount import Mount, Talk
from tests.support.in_process_gateway import Bridge
from tests.support.simulated_meade import MODELS, meade, overhead
from tests.unit.protocols.lx200.surface.test_unterminated import BYTE, QUIET, WAYS, done

# --- what was refused leaves nothing chosen -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("refused", "reply"),
    [
        (b":Ls2#", b"2"),
        (b":Lsx#", b"2"),
        (b":Lo9#", b"0"),
        (b":Lo#", b"0"),
        (b":Lo1:LC31#", b"0"),
        (b":Ls0:LS903#", b"2"),
    ],
)
def test_refused_catalogue_leaves_no_target_for_a_goto(refused: bytes, reply: bytes) -> None:
    talk = Talk(model="lx200")
    assert talk.send(b":Lo0#:Ls3#:LM42#") == b"11"
    talk.now += 1
    assert talk.send(refused) == reply
    talk.now += 1
    assert talk.send(b":MS#") == b"1Catalog not found#"
    talk.send(b":LC224#" if b"Lo" in refused else b":LS32349#")
    assert talk.send(b":MS#") == b"1Catalog not found#"
    assert done(talk) == []
    talk.send(b":Lo0#:LC224#")
    assert talk.send(b":LI#") != b"Catalog not found#"


@pytest.mark.parametrize("lost", [b":LM31:MS#", b":LC224:MS#", b":LS32349:MS#"])
def test_unterminated_object_command_leaves_no_target(lost: bytes) -> None:
    talk = Talk(model="lx200")
    talk.send(b":LM42#")
    talk.now += 1
    assert talk.send(lost) == b""
    talk.now += 1
    assert talk.send(b":MS#").endswith(b"selected#")
    assert done(talk) == []


# --- through a whole gateway --------------------------------------------------------------------------------------


async def test_log_shows_an_unterminated_command_and_why_it_is_refused() -> None:
    async with Bridge() as bridge:
        client = bridge.client()
        assert await client.ask(b":Sr07:00:00:MS#:Mn#") == b"0"
        notes = [entry.note for entry in bridge.entries if entry.arrow == "!"]
        (told,) = [note for note in notes if ":Sr07:00:00:MS#" in note]
        assert "refused" in told and "#" in told and "stop" in told
        assert any("move north" in note and "not done" in note for note in notes)


async def test_stop_inside_an_unterminated_command_ends_the_motion_at_once() -> None:
    async with Bridge() as bridge:
        client = bridge.client()
        await client.ask(b":RM#:Me#")
        await asyncio.sleep(2)
        assert bridge.controller.wanted.axes_moved_by_hand
        stops = bridge.controller.stop_count
        client.send(b":Sr07:00:00:Q#")
        assert bridge.controller.stop_count == stops + 1, "in the very call that brought the bytes"
        await asyncio.sleep(1)
        assert not bridge.controller.wanted.axes_moved_by_hand
        await client.ask(b":RM#:Me#")
        await asyncio.sleep(2)
        client.send(b":SMfoo:Qe#")
        await asyncio.sleep(1)
        assert not bridge.controller.wanted.axes_moved_by_hand


async def test_command_after_an_unfinished_one_gets_no_cached_reply() -> None:
    for presented, question, half, reply in (("lx200", b":GR#", b":Sr07:0", b"0"), ("nexstar", b"e", b"K", b"e#")):
        async with Bridge(presented=presented, surface=None) as bridge:
            client = bridge.client()
            for _ in range(3):
                assert len(await client.ask(question)) > 8
            client.send(half)
            assert await client.ask(question) == reply


async def test_arrow_right_after_an_unterminated_command_and_polls_is_dropped() -> None:
    """A question that is answered again without being cut out belongs to the run of bytes all the same."""
    async with Bridge() as bridge:
        client = bridge.client()
        await client.ask(b":GR#")
        await client.ask(b":GR#")
        await asyncio.sleep(1)
        client.send(b":SMfoo:GR#")
        for _ in range(6):
            client.send(b":GR#")
            await asyncio.sleep(0.05)
        client.send(b":Mn#")
        await asyncio.sleep(1)
        assert not bridge.controller.wanted.axes_moved_by_hand
        client.send(b":Mn#")
        await asyncio.sleep(1)
        assert bridge.controller.wanted.axes_moved_by_hand == {2}


@pytest.mark.parametrize("half", [b":Sr07:00", b":Sr07:00:00:M", b":SMfoo:Sr07:00:00#", b":SMfoo:Sr07:00"])
async def test_next_connection_does_not_complete_half_a_command(half: bytes) -> None:
    """What a connection has kept is handed on to the next one from its host: not a target of which half was lost."""
    async with Bridge() as bridge:
        for sent, reply in ((b"", b"0"), (half, b"1No target set.#")):
            client = bridge.client("10.0.0.7")
            await client.ask(overhead(bridge.sim))
            await asyncio.sleep(1)
            await client.ask(sent)
            client.close()
            client = bridge.client("10.0.0.7")
            assert await client.ask(b":MS#") == reply
            await client.ask(b":Q#")
            await asyncio.sleep(1)
            client.close()


# --- the simulated telescopes -------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("model", MODELS)
def test_simulated_meade_does_not_move_for_an_unterminated_command(model: str, way: str) -> None:
    for lost in (b":Sr07:00:00:MS#", b":SMfoo:Mn#", b":Sr07:\x0600:MS#", b":SMabcdefghijklmnopqrst:Mn#", b":LM31:MS#"):
        sim, clock = meade(model)
        sim.feed(overhead(sim))
        clock.now += 1
        where = sim.mechanics.axes(clock.now)
        reply = b""
        for piece in WAYS[way](lost + b":Me#:MS#"):
            reply += sim.feed(piece)
            clock.now += BYTE
        too_long = len(lost) > 20 and sim.classic  # that is dropped without a word
        assert reply == (b"" if lost.startswith(b":LM") or too_long else b"0"), lost
        assert not sim.slewing and not sim.arrows
        clock.now += QUIET
        sim.feed(b":Me#")
        assert sim.arrows
        sim.feed(b":SMfoo:Qe#")
        assert not sim.arrows and len(where) == 2


def test_meade_behind_a_meade_surface_is_sent_nothing_of_an_unterminated_command() -> None:
    mount = Mount()
    talk = Talk(mount)
    talk.binding.surface.speaks_mount_protocol = True
    talk.send(b":B1:Mn#:BD05:Mn#")
    assert mount.asked == []
