"""A gateway that has been closed leaves nothing behind: whatever its clients still wanted comes to an end by itself."""

from __future__ import annotations

import asyncio

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge
from tests.support.sampling import as_a_rule

LX200 = [b":AP#", b":hN#", b":RS#:Mn#", b":GR#:GA#", b":hW#", b":gT#", b":Mgn0500#", b":SG+01#", b":Qn#", b":$BA10#"]
NEXSTAR = [b"T\x01", b"x", b"P\x02\x11\x24\x09\0\0\0", b"ezLt", b"y", b"W" + bytes(8), b"M", b"r3456000034560000"]


@pytest.mark.parametrize(("presented", "said"), [("lx200", LX200), ("nexstar", NEXSTAR)])
@pytest.mark.parametrize(("driven", "mount"), [("nexstar", "cpc"), ("lx200", "lx200gps")])
def test_closing_the_gateway_ends_all_pending_client_requests(
    presented: str, said: list[bytes], driven: str, mount: str
) -> None:
    async def program(late: float) -> list[str]:
        wrong: list[str] = []
        asyncio.get_running_loop().set_exception_handler(lambda _, context: wrong.append(str(context)))
        async with Bridge(mount, driven=driven, presented=presented, surface=None, latency=0.1) as bridge:
            for start in range(len(said)):
                client = bridge.client(f"127.0.0.{start + 1}")
                for command in said[start:] + said[:start]:
                    client.send(command)
                client.close()
            await asyncio.sleep(late)
        await asyncio.sleep(15.0)
        return wrong + [str(task) for task in asyncio.all_tasks() if task is not asyncio.current_task()]

    for step in range(0, 12, as_a_rule(2, whole=1)):
        assert run(program(0.3 * step)) == []


async def test_closing_ends_requests_to_a_mount_that_was_never_identified() -> None:
    bridge = Bridge("cpc")
    bridge.sim.asleep = True
    bridge.controller.start()
    client = bridge.client()
    await asyncio.sleep(3.0)
    client.send(b":St+45*00#:Sg350*00#:SC01/15/26#:SL22:00:00#:SG+00#:GR#:GD#")
    await asyncio.sleep(12.0)
    client.send(b":St+46*00#")
    await asyncio.sleep(0.2)
    await bridge.controller.close()
    await asyncio.sleep(30.0)
    assert [task for task in asyncio.all_tasks() if task is not asyncio.current_task()] == []
