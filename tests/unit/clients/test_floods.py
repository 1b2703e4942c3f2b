"""Clients that ask without end: the others are served, a stop is as quick as ever, and nothing grows."""

from __future__ import annotations

import asyncio
import gc
import itertools
import logging
import socket
import tracemalloc
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from gateway.clients.commands.turn import MAX_BACKGROUND_OPERATIONS
from gateway.diagnostics.virtual_time import run
from gateway.protocols.base.session import SharedSettings
from gateway.transport import tcp
from gateway.transport.tcp import READ_BYTES, READ_PAUSE
from tests.support.in_process_gateway import Bridge, RehearsalClient
from tests.support.nexstar_flows import precise, up
from tests.support.sampling import as_a_rule
from tests.support.two_gateways import equatorial
from tests.unit.transport.test_ports import address, ask, serving

SLOW = 0.12
#: How often in a round a client leaves everything behind that it can.
MEMORY = as_a_rule(20, whole=60)
#: Guide rates, backlash, tracking rates, arrows: acknowledged at once, and each some exchanges for the mount.
COSTLY = b"".join(
    [
        *(bytes((80, 2, 16 + axis, 70, rate, 0, 0, 0)) for axis in (0, 1) for rate in range(40, 60)),
        *(bytes((80, 3, 16, 6, 255, low, 0, 0)) for low in (255, 254, 253)),
        *(bytes((80, 2, 16 + axis, 36, key, 0, 0, 0)) for axis in (0, 1) for key in (1, 2, 9)),
    ]
)


def flooded(flood: bytes, test: Callable[[Bridge, RehearsalClient], Awaitable[None]], **settings: Any) -> None:
    """A gateway with a slow NexStar behind it, one client that repeats ``flood`` for ever, and another one."""

    async def program() -> None:
        async with Bridge(**{"latency": SLOW, "presented": "nexstar", "surface": "6-8se", **settings}) as bridge:
            bully, other = bridge.client("10.0.0.66"), bridge.client("10.0.0.1")

            async def pour() -> None:
                while True:
                    bully.send(flood)
                    await asyncio.sleep(0.2)

            pouring = bridge.controller.spawn(pour())
            await asyncio.sleep(5)
            await test(bridge, other)
            pouring.cancel()

    run(program())


async def seconds(client: RehearsalClient, command: bytes, until: bytes = b"#") -> float:
    began = asyncio.get_running_loop().time()
    assert await client.ask(command, 60.0, ending=until)
    return asyncio.get_running_loop().time() - began


# --- the mount's line -------------------------------------------------------------------------------------------------


def test_stop_is_sent_before_all_requests_of_a_flooding_client() -> None:
    async def stopped(bridge: Bridge, other: RehearsalClient) -> None:
        for _ in range(3):
            await asyncio.sleep(1.3)
            before, began = len(bridge.entries), asyncio.get_running_loop().time()
            bridge.controller.begin_stop()
            await bridge.controller.reconciler.stop()
            assert asyncio.get_running_loop().time() - began < 8 * SLOW
            first = next(entry for entry in bridge.entries[before:] if entry.side == "mount" and entry.arrow == ">")
            assert first.data in (b"M", bytes((80, 2, 16, 36, 0, 0, 0, 0))), "after the exchange on the wire"

    flooded(COSTLY, stopped)


def test_stop_is_not_delayed_by_a_flood_of_tracking_mode_orders() -> None:
    async def stopped(bridge: Bridge, other: RehearsalClient) -> None:
        for _ in range(5):
            await asyncio.sleep(0.7)
            began = asyncio.get_running_loop().time()
            await bridge.controller.reconciler.stop()
            assert asyncio.get_running_loop().time() - began < 8 * SLOW

    flooded(b":AL#:AP#" * 20, stopped, presented="lx200", surface="autostar")


def test_hundred_simultaneous_stops_are_sent_as_one() -> None:
    async def stopped(bridge: Bridge, other: RehearsalClient) -> None:
        other.send(b":RM#:Mn#")
        await asyncio.sleep(2)
        other.send(b":Q#" * 100)
        names = [getattr(task.get_coro(), "__qualname__", "") for task in asyncio.all_tasks()]
        assert names.count("StopSender._send") == 1
        await asyncio.sleep(3)
        assert not bridge.controller.wanted.stop_owed
        assert not bridge.controller.wanted.axes_moved_by_hand

    flooded(b":GVP#", stopped, presented="lx200", surface="autostar")


def test_joystick_rate_changes_do_not_pile_up_on_a_busy_line() -> None:
    async def steered(bridge: Bridge, other: RehearsalClient) -> None:
        for key in (1, 2, 3, 4, 5, 6, 7, 8, 9, 7):
            other.send(bytes((80, 2, 17, 36, key, 0, 0, 0)))
            await asyncio.sleep(0.02)
        await asyncio.sleep(4)
        keys = [sent[4] for sent in bridge.sent_requests() if sent[:4] == bytes((80, 2, 17, 36))]
        assert keys[-1] == 7
        assert len(keys) <= 4

    flooded(b"Kx", steered)


@pytest.mark.parametrize("flood", [COSTLY, COSTLY[:320], COSTLY[320:344], COSTLY[344:]], ids=lambda f: str(len(f)))
def test_flooding_client_does_not_starve_others_of_answers(flood: bytes) -> None:
    async def told(bridge: Bridge, other: RehearsalClient) -> None:
        waits = []
        for command in (b"e", b"z", b"t", b"L", b"J") * 2:
            began = asyncio.get_running_loop().time()
            if await other.ask(command, 4.0, ending=b"#"):
                waits.append(asyncio.get_running_loop().time() - began)
            await asyncio.sleep(0.31)
        assert len(waits) >= 9, "while it moves, every answer is asked for twice, and anew after each order"
        assert max(waits) < 3.5

    flooded(flood, told)


def test_flood_leaves_another_clients_goto_alone() -> None:
    async def begun(bridge: Bridge, other: RehearsalClient) -> None:
        ra, dec = up(bridge, 40.0)
        assert await other.ask(precise(b"r", ra, dec)) == b"#"
        await asyncio.sleep(10)
        assert any(sent.startswith(b"r") for sent in bridge.sent_requests())

    flooded(COSTLY[:344], begun)


def test_number_of_pending_commands_of_one_client_is_bounded() -> None:
    async def bounded(bridge: Bridge, other: RehearsalClient) -> None:
        assert len(asyncio.all_tasks()) < 2 * MAX_BACKGROUND_OPERATIONS + 30
        assert len(bridge.controller.line.queue) < MAX_BACKGROUND_OPERATIONS + 10

    flooded(COSTLY * 4, bounded)


def test_zero_rate_ends_an_arrow_at_once_behind_300_rate_commands() -> None:
    async def ended(bridge: Bridge, other: RehearsalClient) -> None:
        other.send(bytes((80, 2, 17, 36, 9, 0, 0, 0)) * 300 + bytes((80, 2, 17, 36, 0, 0, 0, 0)))
        await asyncio.sleep(2.0)
        assert 2 not in bridge.controller.wanted.axes_moved_by_hand
        assert bridge.sent_requests().count(bytes((80, 2, 17, 36, 9, 0, 0, 0))) <= 1, (
            "a newer one takes the place of the older"
        )

    flooded(b"e", ended)


def test_repeated_stops_leave_room_for_reads() -> None:
    """Each is several exchanges; a read that waits for all of them is given up after two seconds."""

    async def read(bridge: Bridge, other: RehearsalClient) -> None:
        for _ in range(10):
            assert await seconds(other, b":GA#") < 1.5
            await asyncio.sleep(0.7)

    flooded(b":Q#", read, presented="lx200", surface="autostar")


async def test_newer_goto_of_another_protocol_replaces_a_goto_for_all_programs() -> None:
    async with Bridge() as bridge, _SecondFace(bridge) as celestron:
        meade = bridge.client("10.0.0.1")
        assert await meade.ask(b":Sr%s#:Sd+40*00:00#:MS#" % _hours(up(bridge, 50.0)[0]), ending=b"110") == b"110"
        await asyncio.sleep(1)
        assert await celestron.ask(b"L") == b"1#"
        ra, dec = up(bridge, -30.0)
        assert await celestron.ask(precise(b"r", ra, dec)) == b"#"
        assert await meade.ask(b":D#") == b"\x7f#"
        while await celestron.ask(b"L") == b"1#":
            await asyncio.sleep(1)
        assert await meade.ask(b":D#") == b"#"
        seen = equatorial(await celestron.ask(b"e"))
        assert (seen.ra, seen.dec) == pytest.approx((ra, dec), abs=0.02)
        assert (await meade.ask(b":GR#"))[:5] == _hours(seen.ra)[:5]


def _hours(degrees: float) -> bytes:
    seconds = round(degrees * 240)
    return b"%02d:%02d:%02d" % (seconds // 3600, seconds // 60 % 60, seconds % 60)


class _SecondFace:
    """A client of another protocol at the same mount."""

    def __init__(self, bridge: Bridge) -> None:
        from gateway.app.bindings import make_surface
        from gateway.app.config import Endpoint, SurfaceConfig
        from gateway.clients.acceptor import ConnectionAcceptor
        from gateway.mount.policy import Limits

        face = make_surface(Endpoint("nexstar", "-", "6-8se"), SurfaceConfig(at="-"), Limits())
        self.acceptor = ConnectionAcceptor(bridge.controller, face, SharedSettings(), bridge.clock)

    async def __aenter__(self) -> RehearsalClient:
        return RehearsalClient(self, "10.0.0.2")

    async def __aexit__(self, *_: object) -> None:
        """Nothing to do."""


# --- the connections --------------------------------------------------------------------------------------------------


@pytest.mark.real_time
async def test_position_requests_of_many_clients_are_answered_in_a_flood() -> None:
    async with serving("lx200@tcp://127.0.0.1:0") as gateway:
        links = [await asyncio.open_connection(*address(gateway)) for _ in range(as_a_rule(100, whole=300))]
        loop, done = asyncio.get_running_loop(), asyncio.Event()

        async def pour(flood: bytes) -> None:
            reader, writer = await asyncio.open_connection(*address(gateway))
            while not done.is_set():
                writer.write(flood)
                await asyncio.wait([asyncio.ensure_future(reader.read(1 << 20))], timeout=0.001)
            writer.transport.abort()

        pouring = [asyncio.ensure_future(pour(flood)) for flood in (b":GR#" * 16384, b":" + b"x" * 65535)]
        await asyncio.sleep(0.1)
        waits = []
        for link in links[::5]:
            began = loop.time()
            assert len(await ask(link, b":GR#")) == 9
            waits.append(loop.time() - began)
        done.set()
        await asyncio.gather(*pouring)
        assert sorted(waits)[len(waits) // 2] < 0.05
        assert all(len(answer) == 9 for answer in await asyncio.gather(*(ask(link, b":GR#") for link in links)))
        for link in links:
            link[1].close()


@pytest.mark.real_time
@pytest.mark.parametrize("flood", [b":GR#" * 16384, b":Qe#:Qw#" * 8192, b":RC#:Me#:Qe#" * 87_000, b":GR#", b"x"])
async def test_one_flood_leaves_stop_and_position_of_another_client_alone(flood: bytes) -> None:
    """Whole, a megabyte at once, and byte by byte."""
    async with serving("lx200@tcp://127.0.0.1:0") as gateway:
        loop, done = asyncio.get_running_loop(), asyncio.Event()
        other = await asyncio.open_connection(*address(gateway))

        async def pour() -> None:
            _, writer = await asyncio.open_connection(*address(gateway))
            while not done.is_set():
                for piece in [flood] if len(flood) > 4 else [flood[at : at + 1] for at in range(len(flood))]:
                    writer.write(piece)
                    await asyncio.wait([asyncio.ensure_future(writer.drain())], timeout=0.001)
            writer.transport.abort()

        pouring = asyncio.ensure_future(pour())
        await asyncio.sleep(0.2)
        waits = []
        for _ in range(20):
            began = loop.time()
            assert len(await ask(other, b":GR#")) == 9
            waits.append(loop.time() - began)
        before, began = gateway.controller.stop_count, loop.time()
        other[1].write(b":Q#")
        while gateway.controller.stop_count == before:
            await asyncio.sleep(0)
        assert loop.time() - began < 0.5 and sorted(waits)[len(waits) // 2] < 0.05
        done.set()
        await pouring
        other[1].close()


@pytest.mark.real_time
async def test_every_command_of_a_burst_is_answered() -> None:
    async with serving("lx200@tcp://127.0.0.1:0") as gateway:
        link = await asyncio.open_connection(*address(gateway))
        await ask(link, b":GR#")
        began = asyncio.get_running_loop().time()
        link[1].write(b":GR#" * 1000)
        async with asyncio.timeout(60):
            assert len(await link[0].readexactly(9000)) == 9000
        assert asyncio.get_running_loop().time() - began > 4000 // READ_BYTES * READ_PAUSE * 0.8, (
            "others had their turn"
        )
        link[1].close()


@pytest.mark.real_time
async def test_client_that_does_not_read_is_dropped_without_a_warning(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The replies that still come for it are dropped; the event loop would warn of every one of them."""
    monkeypatch.setattr(tcp, "READ_PAUSE", 0.001)  # else it takes two seconds to say enough

    with caplog.at_level(logging.WARNING, "asyncio"):
        async with serving("lx200@tcp://127.0.0.1:0") as gateway:
            deaf = socket.create_connection(address(gateway))
            deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            deaf.setblocking(False)
            port: Any = gateway.ports[0]
            (connection,) = await _some(port)
            connection._transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
            connection._transport.set_write_buffer_limits(high=2048)
            async with asyncio.timeout(60):
                while port.connections:
                    try:
                        deaf.send(b":GVP#" * (READ_BYTES // 5))
                    except OSError:
                        await asyncio.sleep(0.005)
                    await asyncio.sleep(0)
            deaf.close()
    assert caplog.records == []


async def _some(port: Any) -> list[Any]:
    while not port.connections:
        await asyncio.sleep(0.01)
    return list(port.connections)


@pytest.mark.real_time
async def test_client_sockets_have_tcp_keepalive_of_at_most_a_minute() -> None:
    async with serving("lx200@tcp://127.0.0.1:0") as gateway:
        link = await asyncio.open_connection(*address(gateway))
        await ask(link, b":GR#")
        port: Any = gateway.ports[0]
        (connection,) = port.connections
        mine = connection._transport.get_extra_info("socket")
        assert mine.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
        if hasattr(socket, "TCP_KEEPIDLE"):
            assert mine.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE) <= 60
        link[1].close()


async def test_memory_of_one_client_is_bounded() -> None:
    """Half commands, names, drafts, timers, repeated questions: everything that a connection can leave behind."""
    noise = (
        b":Sr05:3"
        + b"x" * 200
        + b"".join(
            b":%s#" % word
            for word in (b"SMabc", b"SL12:00:00", b"SyGP", b"Sr05:34:32", b"GR", b"GD", b"GA", b"D", b"GVP")
        )
    )
    async with Bridge() as bridge:
        bridge.wire_log.sinks.clear()
        client = bridge.client()

        async def make() -> None:
            for number in range(MEMORY):
                client.send(noise + b":Sz%03d#" % number)
                await asyncio.sleep(0.05)
            client.received = b""
            gc.collect()

        await make()
        tracemalloc.start()
        kept = []
        for _ in range(5):
            await make()
            kept.append(tracemalloc.get_traced_memory()[0])
        tracemalloc.stop()
        # What a client leaves behind adds up in every round; growing caches, and what threads load, only in some.
        assert min(after - before for before, after in itertools.pairwise(kept)) < 300 * MEMORY
