"""Who may come in, who may only look, and what no client of a network ever gets through to a mount."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from msgspec.structs import fields

from gateway.app.config import MountConfig, Source, SurfaceConfig, make_config
from gateway.app.gateway import Gateway
from gateway.app.mount_state import mount_state
from gateway.clients.access import AccessRules, is_read_or_stop, parse_networks
from gateway.core import operations as op
from gateway.core.errors import UserError
from gateway.transport.handler import ConnectionRefused
from gateway.transport.tcp import is_exposed
from tests.support.any_port import AnyBridge
from tests.support.each import each
from tests.support.in_process_gateway import Bridge
from tests.support.nexstar_flows import precise, up
from tests.unit.transport.test_ports import address, ask

LOOKS = AccessRules(read_only=True)


@asynccontextmanager
async def serving(at: str = "tcp://127.0.0.1:0", **keys: Any) -> AsyncIterator[tuple[Gateway, list[str]]]:
    """A gateway on real sockets, and what was warned of."""
    said: list[str] = []
    gateway = Gateway(MountConfig(at="nexstar@sim"), [SurfaceConfig(at=f"lx200@{at}", **keys)], warn=said.append)
    gateway.wire_log.sinks.append(lambda entry: said.append(entry.note) if entry.arrow == "!" else None)
    await gateway.open()
    try:
        async with asyncio.timeout(120):
            assert await gateway.wait_identified(60)
            yield gateway, said
    finally:
        await gateway.close()


async def link(gateway: Gateway, host: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """A connection that comes from this address."""
    return await asyncio.open_connection("127.0.0.1", address(gateway)[1], local_addr=(host, 0))


async def closed(gateway: Gateway, host: str) -> bool:
    """Whether a connection from this host is closed at once and told nothing."""
    reader, writer = await link(gateway, host)
    writer.write(b":GVP#")
    try:
        async with asyncio.timeout(60):
            return await reader.read(100) == b""
    except ConnectionError:
        return True
    finally:
        writer.close()


# --- who may come in --------------------------------------------------------------------------------------------------


@pytest.mark.real_time
async def test_only_configured_networks_may_connect() -> None:
    async with serving(allow=["127.0.0.1", "10.0.0.0/8"]) as (gateway, said):
        for _ in range(3):
            assert await closed(gateway, "127.0.0.2")
        friend = await link(gateway, "127.0.0.1")
        assert await ask(friend, b":GVP#") == b"Autostar#"
        assert len([line for line in said if "connection from 127.0.0.2 refused" in line and "allow" in line]) == 1
        [told] = [line for line in mount_state(gateway.controller).to_state().lately if "127.0.0.2" in line]
        assert "127.0.0.2 refused on surface 1" in told and "allow" in told
        friend[1].close()


@pytest.mark.real_time
async def test_surplus_connection_is_closed_until_another_leaves() -> None:
    async with serving(max_clients=2) as (gateway, said):
        two = [await link(gateway, "127.0.0.1") for _ in range(2)]
        for one in two:
            await ask(one, b":GR#")
        for _ in range(2):
            assert await closed(gateway, "127.0.0.2")
        assert len([line for line in said if "refused on surface" in line and "max-clients" in line]) == 1
        assert len(await ask(two[1], b":GR#")) == 9
        two[0][1].close()
        await asyncio.sleep(0.05)
        assert not await closed(gateway, "127.0.0.2")
        two[1][1].close()


async def test_one_remote_address_may_use_only_three_quarters_of_the_connections() -> None:
    async with AnyBridge(keys={"max_clients": 8}) as bridge:
        first = [bridge.call("10.0.0.1") for _ in range(6)]
        for caller in first[:3]:  # what these speak is known; the others have sent nothing
            await caller.ask(b":GR#")
        with pytest.raises(ConnectionRefused):
            bridge.call("10.0.0.1")
        [told] = [notice.text for notice in bridge.wire_log.recent_notices if notice.side == "10.0.0.1"]
        assert "it has 6 clients already" in told
        bridge.call("10.0.0.2"), bridge.call("127.0.0.1")
    async with AnyBridge(keys={"max_clients": 4}) as bridge:
        assert len([bridge.call() for _ in range(4)]) == 4
        with pytest.raises(ConnectionRefused):
            bridge.call("10.0.0.1")


async def test_pending_commands_of_a_closed_client_count_against_the_limit() -> None:
    """Else whoever closes and comes again could have any number of commands under way."""
    async with Bridge(latency=0.2, access=AccessRules(max_clients=3), presented="nexstar", surface="6-8se") as bridge:
        for _ in range(3):
            client = bridge.client()
            client.send(b"T\2t" * 20)
            client.close()
        with pytest.raises(ConnectionRefused):
            bridge.client()
        await asyncio.sleep(200)
        assert await bridge.client().ask(b"Kx") == b"x#"


@each(
    ("where", "wide"),
    [
        ("tcp://127.0.0.1:4030", False),
        ("tcp://127.8.0.1:4030", False),
        ("tcp://[::1]:4030", False),
        ("tcp://0.0.0.0:4030", True),
        ("tcp://192.168.1.5:4030", True),
        ("tcp://[::]:4030", True),
        ("pty:/tmp/x", False),
    ],
)
@pytest.mark.safety_line(9)
def test_surface_knows_whether_other_computers_can_reach_it(where: str, wide: bool) -> None:
    assert is_exposed(where) is wide


@pytest.mark.parametrize(
    ("keys", "loud"),
    [
        ({}, True),
        ({"allow": ["127.0.0.1"]}, False),
        ({"read_only": True}, False),
        ({"read_only": ["10.0.0.0/8"]}, True),
    ],
)
@pytest.mark.real_time
async def test_run_warns_of_a_port_that_anybody_can_reach(keys: dict[str, Any], loud: bool) -> None:
    async with serving(at="tcp://0.0.0.0:0", **keys) as (gateway, said):
        assert any("no password" in line and "allow" in line for line in gateway.start_warnings()) is loud
        assert not any("password" in line for line in said), "only once it serves"


@pytest.mark.real_time
async def test_surface_without_a_host_accepts_only_this_computer() -> None:
    async with serving(at="tcp://:0") as (gateway, _):
        assert gateway.ports[0].address.startswith("tcp://127.0.0.1:")
        assert list(gateway.start_warnings()) == []


def test_allow_list_accepts_ipv4_ipv6_and_serial_clients() -> None:
    access = AccessRules(allow=parse_networks(["192.168.1.0/24", "fd00::/8", "10.1.2.3"]))
    admitted = ["192.168.1.77", "::ffff:192.168.1.77", "fd12::1", "10.1.2.3"]
    assert [access.admits(host) for host in admitted] == [True] * 4
    assert not any(access.admits(host) for host in ["192.168.2.1", "10.1.2.4", "::1", "fe80::1%eth0", "?", ""])
    assert AccessRules().admits("pty:/tmp/lx200")
    assert AccessRules(read_only=True).is_read_only("pty:/tmp/lx200")


@each(
    ("line", "words"),
    [
        ('allow = ["192.168.1.5/24"]', "'192.168.1.5/24': write 192.168.1.0/24"),
        ('allow = ["home"]', "'home': write a network such as 192.168.1.0/24, or an address"),
        ('allow = "192.168.1.0/24"', 'write a list, each text in "quotes"'),
        ('read-only = ["10.0.0.0/33"]', "'10.0.0.0/33': write a network"),
        ('read-only = "yes"', 'write true or false or a list, each text in "quotes"'),
        ("max-clients = 0", "write a whole number from 1 to 10000"),
    ],
)
def test_mistake_in_an_access_setting_is_reported_with_a_correction(line: str, words: str) -> None:
    import tomli

    text = f'[mount]\nat = "nexstar@sim"\n[[surface]]\nat = "lx200@tcp://:4030"\n{line}\n'
    tables = tomli.loads(text)
    with pytest.raises(UserError, match=f"gateway.toml:5: .*{re.escape(words)}"):
        make_config({**tables, "mount": [tables["mount"]]}, Source("gateway.toml", text))


@pytest.mark.parametrize("key", ["allow", "read-only"])
def test_allow_and_read_only_networks_are_refused_on_a_serial_line(key: str) -> None:
    tables = {"mount": [{"at": "nexstar@sim"}], "surface": [{"at": "lx200@pty:/tmp/x", key: ["10.0.0.0/8"]}]}
    with pytest.raises(UserError, match=f"{key}: .*no network"):
        make_config(tables, Source("gateway.toml"))


# --- who may only look ------------------------------------------------------------------------------------------------


def test_read_only_access_allows_only_reads_and_stops() -> None:
    every = {kind for kind in vars(op).values() if isinstance(kind, type) and issubclass(kind, op.Operation)}
    allowed = {kind for kind in every if issubclass(kind, op.Read)} | {op.AbortMotion, op.StopAxis, op.AbortSlew}
    examples = {op.Focus: [op.Focus(1), op.Focus(-1)], op.PassThrough: [op.PassThrough("x")]}
    for kind in every - {op.Operation}:
        for one in examples.get(kind, [kind(*[1.0] * len(fields(kind)))]):  # the kind decides, not its fields
            assert is_read_or_stop(one) is (kind in allowed), kind
    assert is_read_or_stop(op.Focus(0))


#: What a program sends -> what a client that only looks is told. None: no reply.
LX200_REFUSED: dict[bytes, bytes | None] = {
    b":Sr05:34:32#:Sd+22*00:52#:MS#": b"111Read only.#",
    b":CM#": b"#",
    b":Sz180*00#:Sa+45*00#:MA#": b"111",
    b":St+50*00#": b"0",
    b":Sg010*00#": b"0",
    b":SG+01#:SL12:00:00#:SC01/15/26#": b"000",
    b":ST60.0#": b"0",
    b":SMhere#": b"0",
    b":gT#": b"0",
    b":Mn#": None,
    b":Mge0500#": None,
    b":hP#": None,
    b":hF#": None,
    b":hS#": None,
    b":hN#": None,
    b":hW#": None,
    b":AL#": None,
    b":AP#": None,
    b":TQ#": None,
    b":TL#": None,
    b":T+#": None,
    b":Rg10.0#": None,
    b":F+#": None,
    b"$Q#": None,
    b":$QZ+#": None,
    b":$BA10#": None,
    b":W1#": None,
    b":hI260115220000#": None,
}
LX200_ALLOWED = [
    b":GR#", b":GD#", b":GA#", b":D#", b":GVP#", b":GL#", b":GC#", b":GG#", b":GS#", b":Gt#", b":GM#", b":GW#",
    b":h?#", b":Gr#", b":P#", b":GT#", b"\x06",
]  # fmt: skip


async def test_read_only_lx200_client_cannot_change_the_mount() -> None:
    async with Bridge(access=LOOKS, speed=20) as bridge:
        client = bridge.client()
        for command in LX200_ALLOWED:
            await client.ask(command, 3.0)
        await asyncio.sleep(5)
        before = set(bridge.sent_requests())
        for command, reply in LX200_REFUSED.items():
            heard = await client.ask(command, 0.6, ending=b"\x00")
            assert heard.startswith(reply) if reply else heard == b"", command
        await asyncio.sleep(5)
        for command in LX200_ALLOWED:
            if command != b":Gr#":
                assert await client.ask(command, 3.0), command
        assert await client.ask(b":Sr05:34:32#:Gr#", ending=b"32#") == b"105:34:32#", "the target is its own"
        assert re.fullmatch(rb"0\d\d:\d\d:\d\d#", await client.ask(b":SL12:00:00#:GL#", ending=b"#")), "not silence"
        assert await client.ask(b":GT#") == b"60.1#"
        assert await client.ask(b":GM#") == b"SITE 1#"
        await asyncio.sleep(5)
        assert set(bridge.sent_requests()) <= before | {b"h"}, "nothing but questions has gone to the mount"
        notes = [entry.note for entry in bridge.entries if entry.arrow == "!"]
        assert "Goto refused: read only" in notes
        assert "SetSite refused: read only" in notes or "a setting refused: read only" in notes


async def test_read_only_client_cannot_change_the_site_or_time_zone() -> None:
    """Neither for itself nor for others; what it is told of both is what was there before."""
    async with Bridge(access=AccessRules(read_only=parse_networks(["10.9.0.0/16"])), surface="lx200gps") as bridge:
        owner, looker = bridge.client("10.0.0.1"), bridge.client("10.9.0.1")
        owner.send(b":W3#")
        assert await owner.ask(b":St+50*00#:Sg010*00#", ending=b"11") == b"11"
        owner.send(b":W1#")
        await asyncio.sleep(3)
        looker.send(b":W3#")
        assert await looker.ask(b":SG+07#:SL03:00:00#:GG#", ending=b"#") == b"00+00#"
        for setting in (
            b":SG+01#", b":SL12:00:00#", b":SC01/15/26#", b":St+50*00#", b":Sg010*00#", b":SS12:00:00#",
            b":SMhere#", b":SNhere#", b":SOhere#", b":SPhere#", b":ST60.0#", b":gT#",
        ):  # fmt: skip
            assert await looker.ask(setting) == b"0", setting
        await asyncio.sleep(70)
        assert await looker.ask(b":Gt#", ending=b"#") == await owner.ask(b":Gt#", ending=b"#") == b"+45*00#"
        assert await looker.ask(b":GG#", ending=b"#") == await owner.ask(b":GG#", ending=b"#") == b"+00#"


@pytest.mark.parametrize("stop", [b":Q#", b":Qn#", b":I#"])
async def test_read_only_client_may_stop_the_mount(stop: bytes) -> None:
    access = AccessRules(read_only=parse_networks(["10.9.0.0/16"]))
    async with Bridge(access=access) as bridge:
        mover, looker = bridge.client("10.0.0.1"), bridge.client("10.9.0.1")
        mover.send(b":RM#:Mn#")
        await asyncio.sleep(1)
        assert bridge.controller.wanted.axes_moved_by_hand == {2}
        looker.send(b":Ms#:Me#")
        await asyncio.sleep(1)
        assert bridge.controller.wanted.axes_moved_by_hand == {2}
        looker.send(stop)
        await asyncio.sleep(1)
        assert bridge.controller.wanted.axes_moved_by_hand == set()


async def test_read_only_nexstar_client_cannot_change_the_mount() -> None:
    access = AccessRules(read_only=parse_networks(["10.9.0.0/16"]))
    async with Bridge("cge", access=access, presented="nexstar", surface="cge") as bridge:
        mover, looker = bridge.client("10.0.0.1"), bridge.client("10.9.0.1")
        for command in (b"e", b"z", b"t", b"w", b"h", b"p", b"J", b"L"):
            assert await looker.ask(command)
        await asyncio.sleep(5)
        before = set(bridge.sent_requests())
        ra, dec = up(bridge, 40.0)
        for command in (
            precise(b"r", ra, dec),
            b"R8000,1000",
            b"B8000,1000",
            precise(b"b", 10.0, 20.0),
            precise(b"s", ra, dec),
            b"T\0",
            b"W" + bytes((10, 0, 0, 0, 10, 0, 0, 0)),
            b"H" + bytes((10, 0, 0, 1, 1, 26, 0, 0)),
            b"x",
            b"y",
            b"P\2\x10\x24\5\0\0\0",
            b"P\3\x11\x06\1\0\0\0",
            b"P\4\x10\x02\1\2\3\0",
            b"P\2\x10\x46\5\0\0\0",
            b"P\3\x10\x26\x20\x20\0\0",
            b"P\2\x12\x24\5\0\0\0",
            b"P\1\x10\x12\0\0\0\1",
        ):
            assert (await looker.ask(command, 3.0))[-1:] == b"#", command
            assert await looker.ask(b"L") == b"0#", command
        await asyncio.sleep(5)
        assert set(bridge.sent_requests()) <= before
        assert await mover.ask(precise(b"r", ra, dec)) == b"#"
        await asyncio.sleep(1)
        assert await looker.ask(b"L") == b"1#"
        assert await looker.ask(b"M") == b"#"
        await asyncio.sleep(2)
        assert await mover.ask(b"L") == b"0#"
        mover.send(b"P\2\x10\x24\5\0\0\0")
        await asyncio.sleep(1)
        assert await looker.ask(b"P\2\x10\x24\0\0\0\0") == b"#"
        await asyncio.sleep(1)
        assert bridge.controller.wanted.axes_moved_by_hand == set()


# --- what nobody gets through -----------------------------------------------------------------------------------------

RTC = 178
#: Firmware upload and programming, memory writes (translation of the auxiliary bus: MC and GPS alike).
DEADLY = {0x04, 0x30, 0x31, 0x81, 0x82, 0x83, 0x84}


async def test_no_command_that_writes_into_a_device_reaches_a_mount() -> None:
    """A port sharer, every command id, devices that are there and not, every length."""
    async with Bridge("cge", presented="nexstar", surface="cge", latency=0.0) as bridge:
        client = bridge.client()
        await asyncio.sleep(1)
        for device in (0, 1, 4, 13, 16, 17, 18, 176, RTC, 180, 255):
            for command in DEADLY:
                for length in range(6):
                    await client.ask(bytes((80, length, device, command, 1, 2, 3, 0)), 0.05)
        for command in range(256):  # and no other way to say it
            for device in (16, 18, RTC):
                await client.ask(bytes((80, 1 + command % 4, device, command, 0, 0, 0, 1)), 0.05)
        await asyncio.sleep(5)
        passed = {(sent[2], sent[3]) for sent in bridge.sent_requests() if sent[:1] == b"P"}
        deadly = {(device, command) for device, command in passed if command in DEADLY}
        assert {device for device, command in deadly if command != 0x04} <= {RTC}
        assert {command for device, command in deadly if device == RTC} <= {0x04, 0x83, 0x84}
        assert {device for device, command in deadly if command == 0x04} <= {176, RTC}, "there it reads the year"


def test_forbidden_raw_command_is_blocked_on_every_kind_of_connection() -> None:
    """The surface decides, before it is known how the bytes came: tcp, pty and serial alike."""
    from gateway.protocols.nexstar.surface.devices import NEVER_PASSED, may_be_passed_on
    from gateway.protocols.wireformat.command_set import load

    protocol = load("nexstar")
    for command in DEADLY:
        for device in range(256):
            for length in (*range(8), 255):
                found = protocol.find(bytes((80, length, device, command, 1, 2, 3, 0)))
                if found is None:
                    continue
                row = protocol.surface_rows.get(found[0].name)
                spoken_for = row is not None and row.outcome != "refused"
                assert (
                    spoken_for
                    or found[0].name in NEVER_PASSED
                    or not may_be_passed_on(found[0].name, {"device": device})
                )
                assert command == 0x04 or device == RTC or found[0].name in NEVER_PASSED
