"""Programs for telescopes are never taken for strangers, and none of them waits longer for its first answer.

That no greeting can be the beginning of what a program may say is proven for all of them, byte by byte: ``NEXSTAR`` and
``LX200`` are the protocols' grammars, typed from the manuals. The rest is played: conversations, openings, arguments.
"""

from __future__ import annotations

import asyncio
import random
import re
import tomllib
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import pytest

from gateway.clients.strangers import IDLE_BYTES, Greeting, ReceivedBytes, StrangerFilter, StrangerRecogniser, greetings
from gateway.diagnostics.virtual_time import run
from gateway.protocols.lx200.spec import OPENING as LX200_BEGINNING
from gateway.protocols.nexstar.spec import OPENING as NEXSTAR_BEGINNING
from tests.support.greetings import GREETINGS, TELNET
from tests.support.in_memory_connections import Caller
from tests.support.in_process_gateway import Bridge
from tests.support.manual_files import raw, rows
from tests.support.transcript_files import files, read

ROOT = Path(__file__).parents[3]
Bytes = frozenset[int]
EVERY = frozenset(range(256))


def among(low: int, high: int) -> Bytes:
    return frozenset(range(low, high + 1))


def letters(text: str) -> list[Bytes]:
    return [frozenset((ord(letter),)) for letter in text]


HEX, COMMA, SIXTY, FLAG = frozenset(b"0123456789ABCDEFabcdef"), letters(","), among(0, 59), among(0, 1)
TIME = [among(0, 23), SIXTY, SIXTY, among(1, 12), among(1, 31), EVERY, EVERY, FLAG]
#: One-byte commands that only ask, of any version.
ASKING = "EeZzVvJLMmtwhipl"
#: Everything a hand control's program can say: command by command, the values of every byte.
NEXSTAR = [
    *([frozenset((byte,))] for byte in IDLE_BYTES),
    *(letters(letter) for letter in ASKING + "xyu"),
    [*letters("K"), EVERY],
    [*letters("T"), among(0, 3)],
    *([*letters(letter), *[HEX] * 4, *COMMA, *[HEX] * 4] for letter in "RBS"),
    *([*letters(letter), *[HEX] * 8, *COMMA, *[HEX] * 8] for letter in "rbs"),
    [*letters("P"), among(1, 8), *[EVERY] * 6],
    [*letters("W"), among(0, 90), SIXTY, SIXTY, FLAG, among(0, 180), SIXTY, SIXTY, FLAG],
    [*letters("H"), *TIME],
    [*letters("I"), *TIME],
]
#: A Meade's: an ACK, or a colon and a name, and anything up to a ``#``; what tries other protocols first begins so.
LX200 = [
    *([frozenset((byte,))] for byte in (*IDLE_BYTES, 6)),
    letters("$Q#"),
    letters("$$$"),
    letters("Ka"),
    letters("V"),
    *(
        [
            *letters(":"),
            frozenset(b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz$?"),
            *[EVERY - {35}] * count,
            *letters("#"),
        ]
        for count in range(20)
    ),
]


def can_begin(grammar: list[list[Bytes]], first: tuple[Bytes, ...]) -> bool:
    """Whether some opening of whole commands, and the beginning of one, has these bytes after any idle ones."""
    states = {(-1, 0)}  # between two commands
    for values in first:
        after: set[tuple[int, int]] = set()
        for number, place in states:
            for index, command in enumerate(grammar) if number < 0 else [(number, grammar[number])]:
                if command[place] & values:
                    after.add((-1, 0) if place + 1 == len(command) else (index, place + 1))
        states = after
    return bool(states)


@pytest.mark.parametrize("grammar", [NEXSTAR, LX200], ids=["nexstar", "lx200"])
def test_no_known_http_or_telnet_greeting_begins_like_a_mount_command(grammar: list[list[Bytes]]) -> None:
    assert [greeting for greeting in greetings() if can_begin(grammar, greeting.pattern)] == []
    assert can_begin(NEXSTAR, tuple(letters("EHe")[:1])) and can_begin(LX200, tuple(letters("#:GR#")))


def test_every_known_non_telescope_greeting_is_recognised() -> None:
    for name, data in [*GREETINGS.items(), ("Telnet", TELNET)]:
        for before in (b"", b"#", b"\r\n", b"\0 ?#"):
            assert isinstance(StrangerRecogniser().feed(before + data), Greeting), name
    texts = [bytes(min(octet) for octet in greeting.pattern) for greeting in greetings()]
    assert len(set(texts)) == len(texts)


def test_no_greeting_contains_a_command_that_does_more_than_read() -> None:
    """However it is cut: only these go on before it is known what comes. (Any byte of a row stands for itself here.)"""
    asks = re.compile(rb"(?:[#\r\n\0 ?EeZzVvJLMmtwhipl]|K.)*", re.DOTALL)
    for greeting in greetings():
        text = bytes(0x80 if octet == EVERY else min(octet) for octet in greeting.pattern)
        for commands in (NEXSTAR_BEGINNING, LX200_BEGINNING):
            found = re.match(commands, text[:-1])
            assert found and asks.fullmatch(found.group()), greeting.description


# --- how long anything waits ------------------------------------------------------------------------------------------


def manuals() -> Iterator[tuple[str, bytes]]:
    """Every request form of the manuals, and those beyond them."""
    for name in ("lx200_forms.txt", "lx200_beyond.txt", "nexstar_forms.txt"):
        for row in rows(name):
            yield name.partition("_")[0], raw(row[1])


def profiles() -> Iterator[tuple[str, bytes]]:
    """What single programs are known by, of all profiles."""
    for protocol in ("lx200", "nexstar"):
        for row in tomllib.loads((ROOT / "mappings" / protocol / "clients.toml").read_text("utf-8")).values():
            if "first" in row:
                yield protocol, row["first"].encode("latin-1")


def openings() -> Iterator[tuple[str, bytes]]:
    yield from manuals()
    yield from profiles()
    yield from (("nexstar", command) for command in (b"?E", b"x", b"y", b"u", b"T\2", b"Kx"))
    yield "lx200", b"Ka"
    yield "lx200", b"$$$"


def test_command_filter_passes_every_command_of_the_manuals_at_its_last_byte() -> None:
    found = list(openings())
    assert len(found) > 190
    for protocol, form in found:
        for before, size in product((b"", b"\0", b"#", b"\r\n"), (1, len(form) + 2)):
            request = before + form
            beginning = StrangerFilter(NEXSTAR_BEGINNING if protocol == "nexstar" else LX200_BEGINNING)
            heard = b""
            for at in range(0, len(request), size):
                chunk = request[at : at + size]
                pieces = (
                    [ReceivedBytes(chunk, 0.0, 0)]
                    if beginning.is_done
                    else beginning.feed(ReceivedBytes(chunk, 0.0, 0))
                )
                heard += b"".join(piece.data for piece in pieces)
            assert beginning.stranger is None and heard == request, request


# --- conversations ----------------------------------------------------------------------------------------------------


@pytest.mark.sampled(1)
@pytest.mark.parametrize("apart", [False, True], ids=["one after the other", "each the first of its connection"])
@pytest.mark.parametrize("transport", ["tcp", "rfc2217"])
@pytest.mark.parametrize("path", files("*.txt"), ids=lambda path: path.stem)
def test_program_gets_the_same_replies_as_fast_over_tcp_as_over_serial(path: Path, transport: str, apart: bool) -> None:
    """The first ten packets of every program."""
    lines = [line for line in read(path).lines if line.mark == ">"][:10]
    protocol = path.stem.partition("-")[0]

    async def told(trusted: bool) -> list[tuple[float, bytes]]:
        answers: list[tuple[float, bytes]] = []
        async with Bridge(presented=protocol, surface=None) as bridge:
            loop = asyncio.get_running_loop()
            caller = Caller(bridge.acceptor, transport, trusted=trusted)
            for line in lines:
                if apart:
                    caller.close()
                    caller = Caller(bridge.acceptor, transport, trusted=trusted)
                began, answer = loop.time(), await caller.ask(line.data, 2.0)
                answers.append((round(loop.time() - began, 2), answer))
                assert not caller.gone
        return answers

    assert run(told(trusted=False)) == run(told(trusted=True))


# --- what is kept -----------------------------------------------------------------------------------------------------


def test_bytes_held_back_as_a_possible_greeting_are_bounded() -> None:
    """Never-ending beginnings of every kind: idle bytes, greetings that stop short, anything."""
    longest = max(len(greeting.pattern) for greeting in greetings())
    chance = random.Random(5)
    for commands in (NEXSTAR_BEGINNING, LX200_BEGINNING):
        for _ in range(60):
            beginning = StrangerFilter(commands)
            short = chance.choice(greetings()).pattern[:-1]
            data = bytes(chance.choice(IDLE_BYTES) for _ in range(100)) + bytes(
                chance.choice(sorted(set_)) for set_ in short
            )
            for byte in data:
                if not beginning.is_done:
                    beginning.feed(ReceivedBytes(bytes((byte,)), 0.0, 0))
                assert len(beginning._held_pieces) <= longest


async def test_incomplete_command_is_dropped_though_it_may_become_http() -> None:
    """Half an ``H`` is dropped after a second of quiet, although it might have become HEAD."""
    async with Bridge(presented="nexstar", surface="6-8se") as bridge:
        caller = Caller(bridge.acceptor)
        caller.tell(b"HE")
        await asyncio.sleep(3.0)
        assert await caller.ask(b"Kx") == b"x#"


async def test_move_command_after_a_stop_in_one_tcp_packet_starts_motion() -> None:
    async with Bridge() as bridge:
        Caller(bridge.acceptor).tell(b"#:RS#:Q#:Me#")
        await asyncio.sleep(1.0)
        assert bridge.controller.wanted.axes_moved_by_hand == {1}


async def test_client_on_a_serial_line_is_never_treated_as_a_web_browser() -> None:
    async with Bridge() as bridge:
        client = bridge.client()
        assert re.fullmatch(rb"\d\d:\d\d:\d\d#", await client.ask(b"GET / HTTP/1.1\r\nHost: scope\r\n\r\n#:GR#"))
