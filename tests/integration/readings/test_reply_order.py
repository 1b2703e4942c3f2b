"""Every reply stands in the place of its command, or is absent; none comes after 3.5 s, whatever the mount does.

Random commands in random packets, at a mount that is away, mute, slow, there, and comes and goes. A stop of a NexStar
program is acknowledged always.
"""

from __future__ import annotations

import asyncio
from typing import Any, NamedTuple

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gateway.diagnostics.virtual_time import run
from tests.support.fuzz_forms import PROTOCOLS, of_reply
from tests.support.in_process_gateway import Bridge, RehearsalClient
from tests.support.sampling import as_a_rule

#: Seconds: an answer that is not given within this is never given (NexStar protocol, Communication Protocol).
WITHIN = 3.5
STOPS = (b"M", b"P\x02\x10\x24\x00\x00\x00\x00", b"P\x02\x11\x24\x00\x00\x00\x00")
NEXSTAR = (b"e", b"E", b"z", b"h", b"w", b"V", b"m", b"J", b"t", b"L", b"r40000000,10000000", b"s40000000,10000000",
           b"T\x02", b"P\x01\x10\xfe\x00\x00\x00\x02", b"P\x01\xb0\x37\x00\x00\x00\x01",
           b"P\x02\x10\x24\x05\x00\x00\x00", b"P\x01\x10\x47\x00\x00\x00\x01", *STOPS)  # fmt: skip
LX200 = (b":GR#", b":GD#", b":GA#", b":GZ#", b":GL#", b":GC#", b":Gt#", b":GS#", b":GVP#", b":GW#", b"\x06", b":D#",
         b":Sr08:00:00#", b":Sd+30*00:00#", b":MS#", b":CM#", b":SL21:00:00#", b":St+45*00#", b":Me#", b":Q#", b":Qe#",
         b":TQ#", b":h?#", b":SG+00#", b":Rg10.0#")  # fmt: skip
#: What a mount is like for a while: there after so many seconds, mute, or its port is gone.
WAYS = (0.02, 0.3, 1.2, 2.9, "mute", "gone")


#: Commands that ask for a site's name, each with its own reply.
SITES = (b":GM#", b":GN#", b":GO#", b":GP#")
MARKED = {site: b"Place %d#" % number for number, site in enumerate(SITES)}


class Sent(NamedTuple):
    command: bytes
    at: float


class Reply(NamedTuple):
    data: bytes
    at: float


class Fickle:
    """A wire to a simulated mount that is ``way`` now."""

    name = "sim"

    def __init__(self, bridge: Bridge) -> None:
        self.way: float | str = WAYS[0]
        self._feed = bridge.sim.connection(lambda seconds, answer: self._answer(seconds, answer))
        self._on_data: Any = None
        self._on_lost: Any = None

    async def open(self, on_data: Any, on_lost: Any) -> None:
        if self.way == "gone":
            raise OSError(2, "no such port")
        self._on_data, self._on_lost = on_data, on_lost

    def become(self, way: float | str) -> None:
        self.way = way
        if way == "gone" and self._on_lost is not None:
            self._on_lost("gone")

    def write(self, data: bytes) -> None:
        if not isinstance(self.way, str) and (answer := self._feed(data)):
            self._answer(self.way, answer)

    def _answer(self, seconds: float, answer: bytes) -> None:
        asyncio.get_running_loop().call_later(seconds, self._deliver, answer)

    def _deliver(self, answer: bytes) -> None:
        if self._on_data is not None and not isinstance(self.way, str):
            self._on_data(answer)

    async def close(self) -> None:
        self._on_data = None


class Listener(RehearsalClient):
    """A connection that remembers when each reply came."""

    def __init__(self, bridge: Bridge) -> None:
        self.replies: list[Reply] = []
        super().__init__(bridge, "127.0.0.1")

    def _on_received(self, data: bytes) -> None:
        self.replies.append(Reply(data, asyncio.get_running_loop().time()))


def marker(presented: str, number: int) -> bytes:
    """A command whose reply no other command has, and that needs no mount."""
    return b"K" + bytes((97 + number,)) if presented == "nexstar" else SITES[number]


def check(presented: str, packets: list[list[Sent]], replies: list[Reply]) -> None:
    """Every packet's replies, up to its marker's, can be those of its commands in their order; stops have theirs."""
    rest = [one for reply in replies for one in apart(reply)]
    for packet in packets:
        marked = packet[-1].command
        end = next((number for number, reply in enumerate(rest) if reply.data == own_reply(marked)), None)
        assert end is not None, f"{marked!r} is without a reply: {rest}"
        assert matches(presented, packet, rest[: end + 1]), f"{rest[: end + 1]} are no replies to {packet}"
        rest = rest[end + 1 :]
    assert not rest, f"belong to nobody: {rest}"


def apart(reply: Reply) -> list[Reply]:
    """The same stop several times in a row is acknowledged together."""
    return [Reply(b"#", reply.at)] * len(reply.data) if set(reply.data) == {35} else [reply]


def own_reply(marked: bytes) -> bytes:
    return marked[1:] + b"#" if marked[:1] == b"K" else MARKED[marked]


def matches(presented: str, commands: list[Sent], replies: list[Reply]) -> bool:
    """Whether the replies can belong to the commands, each to one at most, in their order and in time."""
    if not commands:
        return not replies
    first, rest = commands[0], commands[1:]
    if replies and suits(presented, first, replies[0]) and matches(presented, rest, replies[1:]):
        return True
    return not (presented == "nexstar" and first.command in STOPS) and matches(presented, rest, replies)


def suits(presented: str, one: Sent, reply: Reply) -> bool:
    if not one.at <= reply.at <= one.at + WITHIN:
        return False
    if one.command[:1] == b"K" or one.command in MARKED:
        return reply.data == own_reply(one.command)
    return not of_reply(PROTOCOLS[presented], one.command, reply.data)


async def play(
    driven: str, presented: str, ways: list[tuple[float | str, float]], packets: list[tuple[float, list[bytes]]]
) -> None:
    loop = asyncio.get_running_loop()
    bridge = Bridge(
        "cge" if driven == "nexstar" else "lx200gps",
        driven=driven,
        presented=presented,
        surface=None if presented == "nexstar" else "lx200gps",
        config={"lowest": -90.0, "sun": 0.0},
    )
    wire = Fickle(bridge)
    bridge.controller.line.wire = wire  # type: ignore[assignment]
    when = 0.0
    for way, seconds in ways:
        if when:
            loop.call_later(when, wire.become, way)
        else:
            wire.become(way)
        when += seconds
    bridge.controller.start()
    client, sent = Listener(bridge), list[list[Sent]]()
    if presented == "lx200":
        names = b"".join(b":S" + site[2:3] + name for site, name in MARKED.items())
        client.send(names)
        client.replies.clear()
    for number, (pause, commands) in enumerate(packets):
        await asyncio.sleep(pause)
        packet = [*commands, marker(presented, number % len(SITES))]
        sent.append([Sent(command, loop.time()) for command in packet])
        client.send(b"".join(packet))
    await asyncio.sleep(5.0)
    check(presented, sent, client.replies)
    wire.become(WAYS[0])
    await bridge.controller.close()


def packets_of(commands: tuple[bytes, ...]) -> Any:
    pause = st.sampled_from([0.0, 0.0, 0.05, 0.5, 1.7, 3.4, 3.5, 6.0])
    return st.lists(st.tuples(pause, st.lists(st.sampled_from(commands), max_size=4)), min_size=1, max_size=8)


WAYS_IN_TURN = st.lists(st.tuples(st.sampled_from(WAYS), st.sampled_from([0.4, 1.0, 3.0, 8.0])), min_size=1, max_size=5)
EACH = settings(max_examples=as_a_rule(13, whole=20), deadline=None)


@pytest.mark.parametrize("driven", ["nexstar", "lx200"])
@EACH
@given(WAYS_IN_TURN, packets_of(NEXSTAR))
@example([("gone", 4.0), (0.02, 1.0)], [(0.0, [b"e"]), (0.5, [b"h"]), (3.0, [b"w", b"M"])])
@example([("mute", 6.0), (0.02, 1.0)], [(0.0, [b"e", b"z", b"M"]), (1.0, [b"t"]), (4.0, [b"e", b"r40000000,10000000"])])
def test_nexstar_program_gets_every_reply_in_the_order_of_its_commands(driven: str, ways: Any, packets: Any) -> None:
    run(play(driven, "nexstar", ways, packets))


@pytest.mark.parametrize("driven", ["nexstar", "lx200"])
@EACH
@given(WAYS_IN_TURN, packets_of(LX200))
@example([("gone", 4.0), (0.02, 1.0)], [(0.0, [b":GVP#"]), (1.0, [b":St+45*00#"]), (3.0, [b":SL21:00:00#", b":GR#"])])
@example([("mute", 6.0), (0.02, 1.0)], [(0.0, [b":GR#", b":MS#", b":CM#"]), (1.0, [b":GD#"]), (4.0, [b":GZ#"])])
def test_lx200_program_gets_every_reply_in_the_order_of_its_commands(driven: str, ways: Any, packets: Any) -> None:
    run(play(driven, "lx200", ways, packets))


# --- what is done of a command that has no reply any more -------------------------------------------------------------


async def at_a_mount_that_comes_late(driven: str, commands: bytes, later: bytes = b"") -> tuple[Bridge, Listener]:
    """It answers after 8 s; half a minute after that the program asks something else."""
    bridge = Bridge(
        "cge" if driven == "nexstar" else "lx200gps",
        driven=driven,
        surface="lx200gps",
        config={"lowest": -90.0, "sun": 0.0},
    )
    wire = Fickle(bridge)
    bridge.controller.line.wire = wire  # type: ignore[assignment]
    wire.become("mute")
    asyncio.get_running_loop().call_later(8.0, wire.become, WAYS[0])
    bridge.controller.start()
    client = Listener(bridge)
    client.send(commands)
    await asyncio.sleep(40.0)
    client.send(later)
    await asyncio.sleep(1.0)
    await bridge.controller.close()
    return bridge, client


@pytest.mark.parametrize("driven", ["nexstar", "lx200"])
@pytest.mark.parametrize(
    "commands",
    [
        b":Sr08:00:00#:Sd+30*00:00#:MS#",
        b":GR#:Sr08:00:00#:Sd+30*00:00#:MS#",
        b":GR#:Sr08:00:00#:Sd+30*00:00#:CM#",
        b":GR#:RM#:Me#",
        b":hP#",
    ],
)
async def test_motion_is_not_begun_when_its_reply_would_come_too_late(driven: str, commands: bytes) -> None:
    bridge, client = await at_a_mount_that_comes_late(driven, commands)
    begun = (b":MS", b":CM", b":Me", b":hP", b"r", b"s", b"b", b"P\x02\x10\x24\x07", b"P\x03")
    assert not [one for one in bridge.sent_requests() if one.startswith(begun)]
    assert not [reply for reply in client.replies if b"#" in reply.data[1:] and not reply.data.endswith(b".#")]


@pytest.mark.parametrize("driven", ["nexstar", "lx200"])
async def test_setting_reaches_the_mount_though_its_reply_came_too_late(driven: str) -> None:
    _, client = await at_a_mount_that_comes_late(driven, b":GR#:Sr08:00:00#:St+41*30#:Sg010*00#", b":Gr#:Gt#")
    heard = [reply.data for reply in client.replies if reply.data != b"1"]
    assert heard[0] == b"08:00:00#" and heard[1].startswith(b"+41")


async def test_reply_to_a_long_gps_command_is_dropped_once_another_comes() -> None:
    """``:gT#``: "The process can take several minutes to complete." (LX200 protocol, GPS)"""
    for behind, heard in ((b"", [b"1"]), (b":Gr#", [b"00:00:00#"])):
        async with Bridge("lx200gps", driven="lx200", surface="lx200gps") as bridge:
            client = Listener(bridge)
            client.send(b":gT#")
            await asyncio.sleep(10.0)
            client.send(behind)
            await asyncio.sleep(1.0)
            assert [reply.data for reply in client.replies] == heard * bool(behind)
            await asyncio.sleep(90.0)
            assert [reply.data for reply in client.replies] == heard
