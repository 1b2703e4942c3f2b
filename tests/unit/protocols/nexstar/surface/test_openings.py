"""What is no command of the presented hand control moves nothing: every opening of two bytes, every command of every
version, and what real programs send besides; whole, byte by byte, and with bytes behind.
"""

from __future__ import annotations

from collections.abc import Callable

from gateway.core import operations as op
from gateway.protocols.nexstar.framing import NexStarFramer
from gateway.protocols.nexstar.simulator.hand_control import SimulatedHandControl
from gateway.protocols.wireformat.command_set import load
from tests.support.each import each
from tests.support.fake_mount import Talk
from tests.support.sampling import as_a_rule

#: Typed by hand from the manual and from what programs send: opcode -> length, and the version it came with.
LENGTHS = {
    **dict.fromkeys("EeZzVvmJLMtwhilpuxyYno", 1), **dict.fromkeys("KT", 2), "P": 8, **dict.fromkeys("WHI", 9),
    **dict.fromkeys("RBS", 10), **dict.fromkeys("rbsg", 18),
}  # fmt: skip
SINCE = {
    **dict.fromkeys("EZRBVKJLM", (1, 2)), **dict.fromkeys("erTP", (1, 6)), **dict.fromkeys("zbm", (2, 2)),
    **dict.fromkeys("twWhH", (2, 3)), **dict.fromkeys("Ss", (4, 10)), "l": (4, 12), "p": (4, 15),
    **dict.fromkeys("xy", (4, 21)), **dict.fromkeys("iI", (5, 28)), "u": (5, 29),
}  # fmt: skip
STRAY = b"#? \r\n\0"
VERSIONS = {
    "nexstar-gps": ["1.2", "1.6", "2.2"],
    "cge": ["2.3", "3.01", "4.10"],
    "cpc": ["4.03", "4.21"],
    "cgx": ["5.31"],
    "gt": ["101.0", "104.0"],
}
CASES = [(model, version) for model, versions in VERSIONS.items() for version in versions]
GOTO = b"R34AB,12CE"
#: Seconds between two bytes at 9600 baud, and a quiet after which a byte may begin a command again.
BYTE, QUIET = 10 / 9600, 0.11

WAYS: dict[str, Callable[[bytes], list[bytes]]] = {
    "whole": lambda data: [data],
    "byte by byte": lambda data: [data[n : n + 1] for n in range(len(data))],
}


def knows(version: str, letter: str) -> bool:
    """By the manual: a GT before 104.0 is to be treated as 1.2, from then on as 4.03."""
    number = {"101.0": (1, 2), "104.0": (4, 3)}.get(version) or tuple(int(part) for part in version.split("."))
    return letter == "v" or (letter in SINCE and number >= SINCE[letter])


def say(talk: Talk, data: bytes, way: str) -> bytes:
    answer = b""
    for piece in WAYS[way](data):
        answer += talk.send(piece)
        talk.now += BYTE
    return answer


def done(talk: Talk) -> list[op.Operation]:
    """What was asked of the mount beyond reading."""
    return [operation for operation in talk.mount.asked if not isinstance(operation, op.Read)]


# --- the framer, by exhaustion --------------------------------------------------------------------------------------


def _after(opening: bytes, behind: bytes) -> list[bytes]:
    return NexStarFramer().feed(opening + behind, 100.0)


def test_first_two_bytes_on_a_nexstar_port_move_nothing_unless_they_are_commands() -> None:
    """65,792 openings, each with a goto right behind it, and each with a question after a quiet.

    As a rule only every eighth byte behind what begins no command, which is taken for no more than noise.
    """
    ones = [bytes((byte,)) for byte in range(256)]
    few = as_a_rule(8, whole=1)
    strangers = {byte for byte in ones if chr(byte[0]) not in LENGTHS and byte not in [bytes((s,)) for s in STRAY]}
    assert len(strangers) == 256 - len(LENGTHS) - 6
    behind_it = {one: ones[one[0] % few :: few] if one in strangers else ones for one in ones}
    for opening in [*ones, *(one + other for one in ones for other in behind_it[one])]:
        framer = NexStarFramer()
        frames = framer.feed(opening, 100.0)
        assert all(len(frame) == LENGTHS[chr(frame[0])] for frame in frames), opening
        behind = framer.feed(GOTO, 100.05)
        if opening[:1] in strangers:
            assert frames == behind == [], opening
            assert framer.feed(b"Kz", 100.14) == [], opening
            assert framer.feed(b"Kz", 100.14 + QUIET) == [b"Kz"], opening
            continue
        first, rest = chr(opening[0]), opening[1:]
        if first not in LENGTHS:
            assert frames + behind == _after(rest, GOTO), opening
        elif LENGTHS[first] == 1:
            alone = rest and (rest in b"01" if first == "y" else rest in b"\0\1\2\3" if first == "t" else False)
            assert frames + behind == [opening[:1], *_after(b"" if alone else rest, GOTO)], opening
        else:
            whole = opening + GOTO
            assert (frames + behind)[0] == (whole + b"?" * 18)[: LENGTHS[first]] if frames + behind else True, opening
            assert frames + behind == _cut(whole), opening
        assert framer.feed(b"Kz", 102.0) == [b"Kz"], "a quiet second ends whatever it was"


def _cut(data: bytes) -> list[bytes]:
    """The first command by its length, and what comes behind it on its own."""
    length = LENGTHS[chr(data[0])]
    if len(data) < length:
        return []
    tail = data[length:]
    if data[:1] == b"B":
        while len(data) - len(tail) < length + 4 and tail[:1] and tail[:1] in b"0123456789ACDF":
            tail = tail[1:]
    return [data[:length], *_after(tail, b"")]


@each("way", WAYS)
def test_bytes_that_are_no_nexstar_are_dropped_until_the_line_is_quiet(way: str) -> None:
    framer, at = NexStarFramer(), 0.0
    for piece in WAYS[way](b"\xffR34AB,12CExEKz"):
        assert framer.feed(piece, at) == []
        at += BYTE
    assert not framer.idle
    assert framer.feed(b"", at + QUIET) == [] and framer.feed(b"Kz", at + QUIET) == [b"Kz"]
    assert framer.idle


@each("way", WAYS)
def test_stray_bytes_between_nexstar_commands_drop_no_command(way: str) -> None:
    sent = b"?E#e\r\n\0 Kyy1#xt\x02LB7FFF,FFFFF1C7ZP\x02\x10\x24\x00\x00\x00\x00\x00e"
    framer, frames, at = NexStarFramer(), list[bytes](), 0.0
    for piece in WAYS[way](sent):
        frames += framer.feed(piece, at)
        at += BYTE
    assert frames == [
        b"E", b"e", b"Ky", b"y", b"x", b"t", b"L", b"B7FFF,FFFF", b"Z", b"P\x02\x10\x24\x00\x00\x00\x00", b"e",
    ]  # fmt: skip
    assert NexStarFramer().feed(b"y1", 0.0) == [b"y"] and NexStarFramer().feed(b"1E", 0.0) == []


def test_only_one_digit_after_a_nexstar_wake_is_dropped() -> None:
    assert NexStarFramer().feed(b"y11E", 0.0) == [b"y"]
    assert NexStarFramer().feed(b"y1E", 0.0) == [b"y", b"E"]
    assert NexStarFramer().feed(b"yE1E", 0.0) == [b"y", b"E"]


# --- the surface ----------------------------------------------------------------------------------------------------


@each("way", WAYS)
def test_lx200_query_of_a_common_driver_becomes_no_nexstar_goto(way: str) -> None:
    talk = Talk(protocol="nexstar", model="6-8se")
    assert say(talk, b"g34AB0500,12CE0500#", way) == b""
    assert talk.mount.asked == []
    assert say(talk, b"Kz", way) == b"z#"


@each("model, version", CASES)
def test_nexstar_command_unknown_to_a_version_never_reaches_the_mount(model: str, version: str) -> None:
    """Only what the version knows is handed on, whatever the rest of it says."""
    for byte in range(256):
        talk = Talk(protocol="nexstar", model=model, version=version)
        known = knows(version, chr(byte))
        for rest in (b"34AB0500,12CE0500", b"\x02\x10\x24\x09\0\0\0", b"\x04\x10\x02\x12\x34\x56\0"):
            talk.send(bytes((byte,)) + rest)
            talk.now += 1.1
        assert known or done(talk) == [], byte


def test_clock_of_an_old_nexstar_mount_is_not_set() -> None:
    """The manual has those commands since 3.01; before, the device does not answer."""
    frame = b"P\x03\xb2\x83\x04\x06\x00\x00"
    old, new = (Talk(protocol="nexstar", model="cge", version=version) for version in ("2.3", "3.01"))
    assert old.send(frame) == b"\0#" and done(old) == []
    assert new.send(frame) == b"#" and len(done(new)) == 1


def test_log_says_why_a_nexstar_command_gets_no_answer() -> None:
    talk = Talk(protocol="nexstar", model="cpc", version="4.03")
    why = talk.binding.surface.silence_reason(talk.session, b"s34AB0500,12CE0500")
    assert "4.03" in why and "no such command" in why


# --- the simulated hand control -------------------------------------------------------------------------------------


def test_simulated_hand_control_drops_unknown_bytes_until_the_line_is_quiet() -> None:
    now = [1768514400.0]
    sim = SimulatedHandControl("6-8se", "4.21", clock=lambda: now[0])
    assert sim.feed(b"\xffR34AB,12CEKz") == b"" and not sim.slewing
    now[0] += QUIET
    assert sim.feed(b"?Kz") == b"z#"


def test_nexstar_framing_and_command_table_agree_on_lengths() -> None:
    for command in load("nexstar").commands.values():
        letter = chr(command.request.prefix[0])
        assert command.request.length == LENGTHS[letter]
        assert command.name == "v" or letter != command.name or command.first_version == SINCE[letter]
