"""Who may put a mount to sleep: on a serial line whoever likes, over a network nobody but where the operator allows it.

A mount that hibernates is deaf to every program. To wake it is allowed to everybody, everywhere.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.app.bindings import access_rules
from gateway.app.config import MountConfig, Source, SurfaceConfig, make_config
from gateway.app.gateway import Gateway
from gateway.clients.access import AccessRules, Rights
from gateway.core import operations as op
from gateway.core.wire_log import Entry
from tests.support.in_memory_connections import Caller
from tests.support.in_process_gateway import Bridge
from tests.unit.transport.test_ports import address, ask

MOUNTS = {"nexstar": "cpc", "lx200": "lx200gps"}
SLEEP = {"nexstar": b"x", "lx200": b":hN#"}
WAKE = {"nexstar": b"y", "lx200": b":hW#"}
ANSWER = {"nexstar": b"#", "lx200": b""}
QUESTION = {"nexstar": b"Kz", "lx200": b":GVP#"}


def refusals(bridge: Bridge) -> list[str]:
    return [entry.note for entry in bridge.entries if entry.arrow == "!" and "Hibernate refused" in entry.note]


@pytest.mark.parametrize("transport", ["tcp", "rfc2217"])
@pytest.mark.parametrize("surface", ["nexstar", "lx200"])
@pytest.mark.parametrize("mount", ["nexstar", "lx200"])
async def test_hibernation_over_a_network_is_refused_and_the_log_names_the_setting(
    mount: str, surface: str, transport: str
) -> None:
    async with Bridge(MOUNTS[mount], driven=mount, presented=surface, surface=None) as bridge:
        caller = Caller(bridge.acceptor, transport)
        assert await caller.ask(QUESTION[surface])
        assert await caller.ask(SLEEP[surface], 2.0) == ANSWER[surface]
        await asyncio.sleep(10.0)
        assert not bridge.sim.asleep
        assert await caller.ask(QUESTION[surface]), "and it is no stranger for that"
        assert not {b"x", b":hN#"} & set(bridge.sent_requests())
        assert len(refusals(bridge)) == 1
        assert "network" in refusals(bridge)[0] and "hibernate = true" in refusals(bridge)[0]


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("surface", ["nexstar", "lx200"])
@pytest.mark.parametrize("mount", ["nexstar", "lx200"])
async def test_hibernation_over_a_network_is_done_where_the_operator_allows_it(
    mount: str, surface: str, first: bool
) -> None:
    allowed = AccessRules(may_hibernate=True)
    async with Bridge(MOUNTS[mount], driven=mount, presented=surface, surface=None, access=allowed) as bridge:
        caller = Caller(bridge.acceptor)
        if not first:
            await caller.ask(QUESTION[surface])
        assert await caller.ask(SLEEP[surface], 2.0) == ANSWER[surface]
        await asyncio.sleep(10.0)
        assert bridge.sim.asleep and refusals(bridge) == []


@pytest.mark.parametrize("surface", ["nexstar", "lx200"])
@pytest.mark.parametrize("mount", ["nexstar", "lx200"])
async def test_serial_program_may_hibernate_the_mount_and_any_program_may_wake_it(mount: str, surface: str) -> None:
    async with Bridge(MOUNTS[mount], driven=mount, presented=surface, surface=None) as bridge:
        bridge.client().send(SLEEP[surface])
        await asyncio.sleep(10.0)
        assert bridge.sim.asleep and refusals(bridge) == []
        Caller(bridge.acceptor).tell(WAKE[surface])
        await asyncio.sleep(10.0)
        assert not bridge.sim.asleep


def test_hibernation_is_refused_whatever_command_requests_it() -> None:
    every = {kind for kind in vars(op).values() if isinstance(kind, type) and issubclass(kind, op.Operation)}
    rights = Rights(may_hibernate=False)
    assert rights.refusal(op.Hibernate()) is not None and rights.refusal(op.Wake()) is None
    assert Rights().refusal(op.Hibernate()) is None
    assert (
        rights.refusal(op.AbortMotion()) is None
        and Rights(read_only=True, may_hibernate=False).refusal(op.Hibernate()) is not None
    )
    assert {op.Hibernate, op.Wake, op.AbortMotion} <= every


@pytest.mark.real_time
@pytest.mark.parametrize(("keys", "asleep"), [({}, False), ({"hibernate": True}, True), ({"hibernate": False}, False)])
async def test_hibernation_setting_of_the_mount_applies_to_every_network_port(
    keys: dict[str, Any], asleep: bool
) -> None:
    tables = {"mount": [{"at": "nexstar:cpc@sim", **keys}], "surface": [{"at": "nexstar@tcp://127.0.0.1:0"}]}
    config = make_config(tables, Source("gateway.toml"))
    assert access_rules(config.surface[0], config.mount[0]).may_hibernate is asleep
    gateway = Gateway(MountConfig(at="nexstar:cpc@sim", **keys), [SurfaceConfig(at="nexstar@tcp://127.0.0.1:0")])
    decided: asyncio.Future[bool] = asyncio.get_running_loop().create_future()

    def look(entry: Entry) -> None:
        sent = entry.side == "mount" and entry.arrow == ">" and entry.data == b"x"
        if (sent or "Hibernate refused" in entry.note) and not decided.done():
            decided.set_result(sent)

    gateway.wire_log.sinks.append(look)
    await gateway.open()
    try:
        async with asyncio.timeout(60):
            assert await gateway.wait_identified(10)
            link = await asyncio.open_connection(*address(gateway))
            assert await ask(link, b"x") == b"#"
            assert await decided is asleep
            link[1].close()
    finally:
        await gateway.close()
