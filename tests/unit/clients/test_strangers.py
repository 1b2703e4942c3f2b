"""What is no program for telescopes moves nothing: web browsers, port scanners, proxies, whoever finds an open port.

The mount's line is the judge: but for the questions that the gateway itself asks, nothing comes there.
"""

from __future__ import annotations

import asyncio

import pytest

from tests.support.greetings import GREETINGS, TELNET
from tests.support.in_memory_connections import Caller
from tests.support.in_process_gateway import Bridge

MOUNTS = {"nexstar": "cpc", "lx200": "lx200gps"}
QUESTION = {"nexstar": b"e", "lx200": b":GR#"}
#: What a one-byte command that moves nothing may have the gateway ask or tell the mount: E L M V J p h m.
MAY_ASK = {
    "nexstar": {b"E", b"e", b"L", b"M", b"J", b"t", b"h", b"V", b"p"},
    "lx200": {b":GR#", b":GD#", b":D#", b":GW#", b":Q#", b"\x06"},
}
#: Shorter than what makes a hand control forget half a command, and longer.
PAUSES = (0.0, 0.15, 1.2)
HTTP = {"a visit", "Prometheus", "a form", "a look", "a preflight", "a WebDAV folder", "HTTP/2",
        "a method of a page's own", "a method in small letters"}  # fmt: skip


def notes(bridge: Bridge) -> list[str]:
    return [entry.note for entry in bridge.entries if entry.arrow == "!"]


async def own(mount: str, surface: str) -> set[bytes]:
    """What the gateway asks of a mount when its clients ask for the position alone."""
    async with Bridge(MOUNTS[mount], driven=mount, presented=surface, surface=None) as bridge:
        client = Caller(bridge.acceptor)
        for _ in range(8):
            await client.ask(QUESTION[surface])
            await asyncio.sleep(5.0)
        return set(bridge.sent_requests())


@pytest.mark.sampled(1)
@pytest.mark.parametrize("way", ["whole", "byte by byte"])
@pytest.mark.parametrize("transport", ["tcp", "rfc2217"])
@pytest.mark.parametrize("surface", ["nexstar", "lx200"])
@pytest.mark.parametrize("mount", ["nexstar", "lx200"])
async def test_web_or_telnet_client_moves_and_sets_nothing(mount: str, surface: str, transport: str, way: str) -> None:
    allowed = await own(mount, surface) | (MAY_ASK[mount] if way == "byte by byte" else set())
    settings = {"hibernate": True}
    async with Bridge(MOUNTS[mount], driven=mount, presented=surface, surface=None, config=settings) as bridge:
        strangers = GREETINGS if transport == "rfc2217" else {**GREETINGS, "Telnet": TELNET}
        for number, (name, data) in enumerate(strangers.items()):
            before, said = len(bridge.sent_requests()), len(notes(bridge))
            caller = Caller(bridge.acceptor, transport, number=50000 + number)
            if way == "whole":
                caller.tell(data)
            else:
                await caller.dribble((b"", b"#", b"\n", b"\r\n")[number % 4] + data, PAUSES)
            await asyncio.sleep(0.5)
            assert caller.gone, name
            told = [note for note in notes(bridge)[said:] if "sends" in note]
            assert len(told) == 1 and "the connection is closed" in told[0], (name, told)
            assert set(bridge.sent_requests()[before:]) <= allowed, (name, bridge.sent_requests()[before:])
            assert not bridge.sim.slewing and not bridge.sim.asleep, name
            if way == "whole":
                assert caller.heard.startswith(b"HTTP/1.1 400 ") if name in HTTP else True, name
                assert caller.heard == b"" or name in HTTP or b"HTTP" in caller.heard, name
        friend = Caller(bridge.acceptor, transport)
        assert await friend.ask(QUESTION[surface])


# --- what a stranger leaves behind ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("gone", "seconds"), [(True, 8), (False, 34)])
async def test_web_request_of_the_same_host_keeps_no_arrow_moving(gone: bool, seconds: int) -> None:
    """A web page that asks again and again must not keep an arrow going whose program is gone, or has died."""
    async with Bridge() as bridge:
        mover = Caller(bridge.acceptor)
        mover.tell(b":RS#:Me#")
        await asyncio.sleep(1.0)
        assert bridge.controller.wanted.axes_moved_by_hand == {1}
        if gone:
            mover.close()
        for number in range(seconds // 2):
            Caller(bridge.acceptor, number=50001 + number).tell(GREETINGS["a visit"])
            await asyncio.sleep(2.0)
        assert bridge.controller.wanted.axes_moved_by_hand == set()


async def test_web_client_is_not_counted_as_a_program_and_takes_over_no_session() -> None:
    """What a program keeps for its next connection is kept for a minute, whoever calls meanwhile."""
    async with Bridge() as bridge:
        first = Caller(bridge.acceptor)
        assert await first.ask(b":Sr05:34:32#") == b"1"
        first.close()
        await asyncio.sleep(40.0)
        for name in ("a visit", "TLS"):
            Caller(bridge.acceptor).tell(GREETINGS[name])
        assert len(bridge.acceptor.hosts_present()) == 0
        await asyncio.sleep(30.0)
        assert await Caller(bridge.acceptor).ask(b":Gr#") != b"05:34:32#"
