"""A mount shared with programs of its own kind: they see the mount itself, and nothing that contradicts the gateway.

The bytes are typed by hand; truth is the simulated mount, asked by a connection of its own.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from gateway.app.bindings import presents_mount
from gateway.app.config import MountConfig, SurfaceConfig, parse_endpoint
from gateway.app.gateway import Gateway
from gateway.app.simulated import make_simulator
from gateway.clients.access import AccessRules
from gateway.diagnostics.virtual_time import run
from gateway.mount.link.line import MountLink
from gateway.transport.wires import SimulatedTransport
from tests.support.in_process_gateway import Bridge
from tests.support.transparent import ALLOWED, MOUNTS, asked_of, differences

APPROACH = b"P\1\x10\xfc\0\0\0\1"
MOTORS = b"P\1\x10\xfe\0\0\0\2"
ARROW = b"P\2\x10\x24\5\0\0\0"
GUIDE_RATE, SET_GUIDE_RATE = b"P\1\x10\x47\0\0\0\1", b"P\2\x10\x46\x40\0\0\0"


def shared(mount: str, version: str | None = None, **settings: Any) -> Callable[[Callable[..., Awaitable[None]]], None]:
    """Play a test, at once, on a mount behind a gateway of its own protocol for which nobody has named a model."""

    def play(test: Callable[[Bridge], Awaitable[None]]) -> None:
        async def played() -> None:
            protocol = "lx200" if "lx200" in mount or mount == "autostar" else "nexstar"
            async with Bridge(mount, version, driven=protocol, presented=protocol, surface=None, **settings) as bridge:
                await test(bridge)

        run(played())

    return play


@pytest.mark.parametrize(("protocol", "model", "version"), MOUNTS, ids=lambda part: str(part))
def test_transparent_surface_gives_the_mounts_replies(protocol: str, model: str, version: str | None) -> None:
    assert asked_of(protocol) == 91
    found = run(differences(protocol, model, version))
    assert len(found) <= ALLOWED, found


async def test_port_configured_as_another_model_answers_as_that_model() -> None:
    cpc = parse_endpoint("nexstar:cpc/4.21@sim")
    assert presents_mount(cpc, parse_endpoint("nexstar@tcp://:4030"))
    assert not presents_mount(cpc, parse_endpoint("nexstar:6-8se@tcp://:4030"))
    assert not presents_mount(cpc, parse_endpoint("lx200@tcp://:4030"))
    async with Bridge("slt", "4.03", presented="nexstar", surface="6-8se") as bridge:
        client = bridge.client()
        assert await client.ask(b"m") == b"\x0c#"
        assert await client.ask(b"V") == b"\x04\x15#"
        assert await client.ask(APPROACH) == b"\0\0#"
        assert APPROACH not in bridge.sent_requests()


# --- a NexStar ------------------------------------------------------------------------------------------------------


def test_constant_value_is_read_once_for_all_programs() -> None:
    @shared("cge")
    async def once(bridge: Bridge) -> None:
        clients = [bridge.client(f"10.0.0.{number}") for number in range(1, 6)]
        await clients[0].ask(MOTORS)
        before = len(bridge.sent_requests())
        for _ in range(10):
            for client in clients:
                assert await client.ask(MOTORS) == b"\5\n#"
            await asyncio.sleep(1.0)
        assert MOTORS not in bridge.sent_requests()[before:]


def test_polls_of_many_programs_cost_the_line_no_more_than_those_of_one() -> None:
    @shared("cge")
    async def polled(bridge: Bridge) -> None:
        clients = [bridge.client(f"10.0.0.{number}") for number in range(1, 21)]
        await clients[0].ask(APPROACH)
        before = len(bridge.sent_requests())
        for _ in range(20):
            assert {await client.ask(APPROACH) for client in clients} == {b"\1#"}
            await asyncio.sleep(0.5)
        assert bridge.sent_requests()[before:].count(APPROACH) <= 25


def test_reading_cached_before_an_arrow_is_read_anew() -> None:
    @shared("cge")
    async def outdated(bridge: Bridge) -> None:
        one, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
        assert await one.ask(APPROACH) == b"\1#"
        before = len(bridge.sent_requests())
        assert await other.ask(APPROACH) == b"\1#" and APPROACH not in bridge.sent_requests()[before:]
        one.send(ARROW)
        await asyncio.sleep(0.2)
        assert await other.ask(APPROACH) == b"\1#" and APPROACH in bridge.sent_requests()[before:]


def test_setting_by_one_program_is_reported_to_all_at_once() -> None:
    @shared("cgx", "5.31")
    async def told(bridge: Bridge) -> None:
        one, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
        assert await other.ask(GUIDE_RATE) == b"\x80#"
        one.send(SET_GUIDE_RATE)
        other.send(GUIDE_RATE)  # a question that goes out while the order does
        await asyncio.sleep(0.3)
        assert await other.ask(GUIDE_RATE) == await one.ask(GUIDE_RATE) == b"\x40#"


def test_emulated_clock_is_reported_by_the_clock_device_too() -> None:
    """An aligned hand control is not told the time: what the program set counts for it, whatever it asks."""

    @shared("cge")
    async def kept(bridge: Bridge) -> None:
        client = bridge.client()
        assert (await client.ask(b"P\1\xb2\x33\0\0\0\3"))[:2] == b"\x16\0"  # 22 o'clock
        assert await client.ask(b"H\x0c\x1e\0\1\x0f\x1a\0\0") == b"#"  # half past twelve
        await asyncio.sleep(3.0)
        assert (await client.ask(b"h"))[:2] == b"\x0c\x1e"
        assert (await client.ask(b"P\1\xb2\x33\0\0\0\3"))[:2] == b"\x0c\x1e"


@pytest.mark.parametrize("unlisted", [
    b"P\1\x10\x63\0\0\0\1", b"P\1\x10\x30\0\0\0\1", b"P\1\x10\x19\0\0\0\0", b"P\1\x10\x0b\0\0\0\0",
    b"P\2\x10\xfd\1\0\0\0", b"P\4\x10\4\0\0\0\0", b"P\1\x10\x38\0\0\0\0",
    b"P\2\x10\x81\0\0\0\1", b"P\2\x10\x31\0\0\0\1", b"P\2\x10\x84\0\0\0\1",
    b"P\2\0\x24\t\0\0\0", b"P\4\0\2\x10\0\0\0", b"P\4\0\x17\x10\0\0\0", b"P\4\0\6\x10\0\0\0",
])  # fmt: skip
def test_unlisted_raw_command_is_not_passed_on(unlisted: bytes) -> None:
    """An unknown number, memory, a search for the index or the switch, the approach, a motor's position,
    cord wrap, and motion of all devices on the bus at once."""

    @shared("cgx", "5.31")
    async def stays(bridge: Bridge) -> None:
        assert await bridge.client().ask(unlisted) == bytes(unlisted[7] + 1) + b"#"
        assert unlisted not in bridge.sent_requests()


def test_surface_of_a_polar_fork_reports_axes_like_the_hand_control() -> None:
    @shared("cpc")
    async def polar(bridge: Bridge) -> None:
        client, direct = bridge.client(), bridge.sim.connection()
        assert await client.ask(b"T\2") == b"#"
        await asyncio.sleep(8.0)
        assert await client.ask(b"T\0") == b"#"
        await asyncio.sleep(8.0)
        assert await client.ask(b"z", ending=b"#") == direct(b"z")
        assert await client.ask(b"P\1\x11\1\0\0\0\3") == direct(b"P\1\x11\1\0\0\0\3")


def test_goto_beyond_a_limit_never_reaches_a_shared_mount() -> None:
    @shared("cpc", config={"lowest": 20.0})
    async def limits(bridge: Bridge) -> None:
        client = bridge.client()
        assert await client.ask(b"b20000000,05000000") == b"#"  # 7 degrees above the horizon
        await asyncio.sleep(2.0)
        assert await client.ask(b"L") == b"0#"
        assert not any(sent.startswith(b"b") for sent in bridge.sent_requests())


def test_gateway_answers_v_for_a_hand_control_that_lacks_the_command() -> None:
    @shared("6-8se")
    async def mute(bridge: Bridge) -> None:
        answers = bridge.sim._opcodes
        bridge.sim._opcodes = answers - {ord("v")}
        client = bridge.client()
        assert await client.ask(b"v") == b"\x11#"
        before = len(bridge.sent_requests())
        assert await client.ask(b"v") == b"\x11#"
        assert b"v" not in bridge.sent_requests()[before:]


def test_setting_by_a_read_only_program_does_not_reach_the_mount() -> None:
    @shared("cge", access=AccessRules(read_only=True))
    async def looks(bridge: Bridge) -> None:
        client = bridge.client()
        assert await client.ask(APPROACH) == b"\1#"
        assert await client.ask(SET_GUIDE_RATE) == b"\0#"
        assert SET_GUIDE_RATE not in bridge.sent_requests()


def test_another_mount_behind_the_same_cable_is_identified_anew() -> None:
    @shared("cge")
    async def changed(bridge: Bridge) -> None:
        client = bridge.client()
        assert await client.ask(MOTORS) == b"\5\n#"
        assert await client.ask(b"m") == b"\5#"
        bridge.sim.firmware, bridge.sim.facts = (6, 16), {**bridge.sim.facts, "id": 20}
        bridge.controller.line._state = "down"
        bridge.controller.line._mark_up()
        await asyncio.sleep(5.0)
        assert await client.ask(MOTORS) == b"\6\x10#"
        assert await client.ask(b"m") == b"\x14#"


@pytest.mark.parametrize(("mount", "told"), [
    ("nexstar:avx/5.31", "nexstar:avx"), ("nexstar:gt/104.0", "nexstar:gt"), ("lx200:lx200-16", "lx200:lx200-16"),
])  # fmt: skip
async def test_gateway_presents_the_mount_that_it_has_found(mount: str, told: str) -> None:
    """As it is started by a person: the surface is named by its protocol alone."""
    at = parse_endpoint(f"{mount}@sim")
    surface = SurfaceConfig(at=f"{at.protocol}@tcp://127.0.0.1:0")
    clock = asyncio.get_running_loop().time
    gateway = Gateway(MountConfig(at=f"{at.protocol}@sim"), [surface], clock=clock)
    simulator = make_simulator(at, clock=clock)
    gateway.prepare(
        lambda reply_rules, transcript: MountLink(
            SimulatedTransport("sim", simulator.connection, 0.02), reply_rules, transcript
        )
    )
    gateway.open_line()
    assert await gateway.wait_identified(30.0)
    ((protocol, face),) = gateway.bindings
    assert f"{protocol}:{face.model['name']}" == told
    assert gateway.acceptors[0].binding.model is face.model
    await gateway.close()


# --- a Meade --------------------------------------------------------------------------------------------------------


def test_two_programs_select_objects_and_go_each_to_its_target() -> None:
    @shared("lx200", config={"sun": 0.0, "lowest": -90.0})
    async def both(bridge: Bridge) -> None:
        one, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
        one.send(b":LM42#")
        other.send(b":LM31#")
        await asyncio.sleep(3.0)
        assert await one.ask(b":LI#", ending=b"#") == b"M42 DIFF NEB#"
        assert await other.ask(b":LI#", ending=b"#") == b"M31 GALAXY#"
        assert (await one.ask(b":Gr#", ending=b"#"))[:5] == b"05:36"
        assert await one.ask(b":MS#") == b"0"
        assert [sent for sent in bridge.sent_requests() if sent.startswith(b":Sr")][-1][:8] == b":Sr05:36"
        other.send(b":Q#")


def test_goto_to_an_object_of_a_j2000_telescope_arrives_at_its_place() -> None:
    """What is sent to it for the goto is what it told itself, whatever its coordinates mean."""

    @shared("lx200", config={"equinox": "j2000", "sun": 0.0, "lowest": -90.0})
    async def counts(bridge: Bridge) -> None:
        client, direct = bridge.client(), bridge.sim.connection()
        client.send(b":LM42#")
        await asyncio.sleep(3.0)
        told = direct(b":Gr#")
        assert (await client.ask(b":Gr#", ending=b"#")) != told, "programs are told it of date"
        assert await client.ask(b":MS#") == b"0"
        assert [sent for sent in bridge.sent_requests() if sent.startswith(b":Sr")][-1] == b":Sr" + told
        client.send(b":Q#")


def test_unknown_object_number_leaves_the_programs_target() -> None:
    @shared("lx200")
    async def unknown(bridge: Bridge) -> None:
        one, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
        other.send(b":LM13#")
        await asyncio.sleep(2.0)
        assert await one.ask(b":Sr06:00:00#:Sd+20*00:00#", ending=b"11") == b"11"
        one.send(b":LM110#")
        await asyncio.sleep(2.0)
        assert await one.ask(b":Gr#", ending=b"#") == b"06:00:00#"


def test_latitude_set_alone_is_reported_instead_of_the_mounts() -> None:
    """Half a site is not the telescope's yet: what was just acknowledged is what is told."""

    @shared("lx200gps")
    async def kept(bridge: Bridge) -> None:
        client = bridge.client()
        assert await client.ask(b":Gt#", ending=b"#") == b"+45\xdf00:00#"
        assert await client.ask(b":St+46*30#") == b"1"
        assert await client.ask(b":Gt#", ending=b"#") == b"+46\xdf30:00#"
        await asyncio.sleep(5.0)
        assert await client.ask(b":Gt#", ending=b"#") == bridge.sim.feed(b":Gt#")


def test_commands_that_a_model_lacks_get_no_answer() -> None:
    @shared("lx200")
    async def lacks(bridge: Bridge) -> None:
        client = bridge.client()
        for command in (b":GW#", b":h?#", b":GVP#", b":gps#"):
            assert await client.ask(command, 3.0) == b"", command
        assert any("this mount has no such command" in entry.note for entry in bridge.entries)


def test_command_that_a_firmware_ignores_delays_no_other_program() -> None:
    """Some know less than their manual: no is said where there is a form for it, and other programs notice nothing."""

    @shared("autostar")
    async def mute(bridge: Bridge) -> None:
        supports = bridge.sim.supports
        bridge.sim.supports = lambda name: name not in ("GM", "SM", "Gb") and supports(name)
        client = bridge.client()
        assert await client.ask(b":GM#", 8.0) == b""
        assert await client.ask(b":SMPIER#", 8.0) == b"0"
        assert bridge.controller.line.state == "up"
        before = len(bridge.sent_requests())
        assert await client.ask(b":GM#", 2.0) == b""
        assert b":GM#" not in bridge.sent_requests()[before:], "it is not asked what it does not know again and again"


def test_high_precision_pointing_is_not_passed_on() -> None:
    @shared("autostar")
    async def stays(bridge: Bridge) -> None:
        assert await bridge.client().ask(b":P#") == b"LOW  PRECISION"
        assert b":P#" not in bridge.sent_requests()
