"""A command with an argument that lost its ``#``: refused as a whole, and nothing that came with it moves the mount.

Whole, byte by byte at 9600 baud, and with bytes behind; a stop is carried out wherever it stands.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.core import operations as op
from gateway.protocols.base.frames import Suspect, Unterminated
from gateway.protocols.lx200.framing import MAX_COMMAND_LENGTH, Lx200Framer, stop_commands
from gateway.protocols.wireformat.command_set import load
from tests.support.each import each
from tests.support.examples import some
from tests.support.fake_mount import Talk
from tests.support.manual_files import raw, rows

TARGET = b":Sr05:34:32#:Sd+22*00:52#"
#: Seconds between two bytes at 9600 baud, and two pauses: one that ends a run of bytes, and one that does not.
BYTE, QUIET, SHORT = 10 / 9600, 0.11, 0.09

#: Pieces of what a program sends, and how they come.
WAYS: dict[str, Callable[[bytes], list[bytes]]] = {
    "whole": lambda data: [data],
    "byte by byte": lambda data: [data[n : n + 1] for n in range(len(data))],
}


def say(talk: Talk, data: bytes, way: str = "whole", pause: float = BYTE) -> bytes:
    answer = b""
    for piece in WAYS[way](data):
        answer += talk.send(piece)
        talk.now += pause
    return answer


def done(talk: Talk) -> list[op.Operation]:
    """What was asked of the mount beyond reading."""
    return [operation for operation in talk.mount.asked if not isinstance(operation, op.Read)]


def aimed(**settings: Any) -> Talk:
    """A client that has set a target some time ago."""
    talk = Talk(**settings)
    assert talk.send(TARGET) == b"11"
    talk.now += 1
    return talk


# --- refused as a whole -------------------------------------------------------------------------------------------


@each("way", WAYS)
@each(
    "lost",
    [
        b":Sr07:00:00:MS#", b":Sd+12*30:00:MS#", b":Sr07:00:00:Sd+12*00:MS#", b":Sr:MS#", b":SMfoo:Sr07:00:00#",
        b":Sr07:\x0600:00#", b":SMa:Sd+1\x06:MS#", b":Sr07:00:00:GR#",
    ],
)  # fmt: skip
def test_unterminated_setter_is_refused_once_and_clears_the_target(lost: bytes, way: str) -> None:
    talk = aimed()
    assert say(talk, lost, way) == b"0"
    assert talk.mount.asked == []
    talk.now += QUIET
    assert say(talk, b":MS#", way) == b"1No target set.#"
    assert say(talk, TARGET + b":MS#", way) == b"110"


@each("way", WAYS)
def test_unterminated_setter_leaves_the_stored_values_alone(way: str) -> None:
    talk = aimed()
    assert say(talk, b":SMfoo:Mn#", way) == b"0"
    assert done(talk) == []
    talk.now += QUIET
    assert say(talk, b":GM#:Gr#:MS#", way) == b"SITE 1#05:34:32#0"


@each("way", WAYS)
def test_commands_behind_an_unterminated_setter_are_answered_but_move_nothing(way: str) -> None:
    talk = aimed()
    sent = b":SMfoo:Mn#:GR#:MS#:Me#:hP#:Sz180*00#:Sa+45*00#:MA#:Mgn0500#:F+#:Gc#"
    assert say(talk, sent, way) == b"012:34:56#1A command before this one was damaged.#11124#"
    assert done(talk) == []
    talk.now += SHORT
    assert talk.send(b":Mn#:MS#").startswith(b"1A") and done(talk) == []
    talk.now += QUIET
    assert talk.send(b":Mn#") == b"" and isinstance(done(talk)[0], op.Move)
    assert talk.send(b":MS#") == b"0"


@each("way", WAYS)
@each("stop", stop_commands())
def test_stop_inside_or_behind_an_unterminated_setter_is_carried_out(stop: bytes, way: str) -> None:
    for sent in (
        b":Sr07:00:00" + stop,
        b":SMfoo:Mn" + stop,
        b":SMfoo:Mn#" + stop,
        b":SMfoo:Mn#:MS#:GR#" + stop,
        b":SMfoo" + stop[:-1] + b":Mn#",
        b":SM" + b"x" * 100 + stop,
        b":Sr\x06" + stop,
    ):
        talk = aimed()
        say(talk, sent, way)
        (ended,) = done(talk)
        assert isinstance(ended, op.AbortMotion | op.StopAxis) or ended == op.Focus(0), sent


@each("cut", range(1, 15))
def test_lx200_stop_is_carried_out_after_a_pause_at_any_byte(cut: int) -> None:
    sent = b":Sr07:00:MS:Q#"
    talk = aimed()
    say(talk, sent[:cut])
    talk.now += QUIET
    say(talk, sent[cut:])
    assert [type(operation) for operation in done(talk)] == [op.AbortMotion]


@some
@given(
    st.lists(st.sampled_from([b":", b"S", b"Sr", b"SM", b"Q", b"#", b"\x06", b"$", b"M", b"07", b"x" * 40, b"\r"])),
    st.lists(st.sampled_from([0.0, 0.05, 0.2, 2.0]), min_size=1),
)
def test_lx200_stop_is_passed_on_whatever_bytes_precede_it(before: list[bytes], pauses: list[float]) -> None:
    framer, now, frames = Lx200Framer(), 0.0, list[bytes]()
    for number, piece in enumerate([*before, b":", b"Q", b"#"]):
        now += pauses[number % len(pauses)]
        frames += framer.feed(piece, now)
    assert frames[-1] == b":Q#"
    assert framer.feed(b":Qe#", now)[-1] == b":Qe#"


def test_lx200_framing_knows_every_stop_command() -> None:
    lx200 = load("lx200")
    ends = {
        command.request.encode({})
        for name, command in lx200.commands.items()
        if lx200.surface_rows[name].operations
        and set(lx200.surface_rows[name].operations) <= {"AbortMotion", "StopAxis"}
    }
    assert ends | {b":FQ#"} == set(stop_commands())


# --- every command with an argument -------------------------------------------------------------------------------

EXAMPLES = [raw(row[1]) for file in ("lx200_forms.txt", "lx200_beyond.txt") for row in rows(file)]
SETTERS = [
    (found[0].name, example)
    for example in EXAMPLES
    if (found := load("lx200").find(example)) is not None and found[0].request.fields
]


@pytest.mark.parametrize("model", ["autostar", "lx200"])
@each("name, example", SETTERS)
def test_unterminated_command_with_an_argument_lets_no_motion_through(name: str, example: bytes, model: str) -> None:
    refusals = [reply.wire for reply, _ in load("lx200").commands[name].replies if reply.fault]
    assert refusals in (["2"] if name == "Ls" else ["0"], [])
    refusal = "".join(map(str, refusals)).encode()
    for way in WAYS:
        talk = aimed(model=model)
        shared = repr(talk.session.shared)
        assert say(talk, example.removesuffix(b"#") + b":Mn#:Me#", way) == refusal
        assert talk.mount.asked == [] and repr(talk.session.shared) == shared
        assert talk.deferred == []
        talk.now += QUIET
        assert say(talk, b":GR#", way) == b"12:34:56#"


def test_lx200_framing_knows_every_command_with_an_argument() -> None:
    with_argument = {name for name, command in load("lx200").commands.items() if command.request.fields}
    assert {name for name, _ in SETTERS} == with_argument


@each("way", WAYS)
def test_unterminated_setter_of_another_maker_gets_no_reply_and_moves_nothing(way: str) -> None:
    talk = aimed()
    assert say(talk, b":SX99,1:Mn#:Me#:GR#", way) == b"12:34:56#"
    assert done(talk) == []


@each("way", WAYS)
def test_overlong_unterminated_setter_is_refused(way: str) -> None:
    for long in (b":SM" + b"a" * 70 + b":Mn#:Me#", b":Sr" + b":1" * 500 + b":MS#:Me#", b":SM" + b"a" * 62 + b"#:Me#"):
        talk = aimed()
        assert say(talk, long, way) == b"0" and done(talk) == []


@each("endless", [b":Sr1", b":LM1:W2:Rx", b":S\xff", b"\x06", b":Sr1\x06"])
def test_endless_lx200_command_takes_no_memory(endless: bytes) -> None:
    framer = Lx200Framer()
    assert framer.feed(b":Sr1:Sd1" + endless * 4_000, 0.0) == []
    assert len(framer._frame) <= MAX_COMMAND_LENGTH and len(framer._unterminated_text) <= MAX_COMMAND_LENGTH
    assert len(framer._unterminated_names) <= len(load("lx200").commands)


# --- left as it was -----------------------------------------------------------------------------------------------


@each("way", WAYS)
@each(
    ("sent", "reply", "moved"),
    [
        (b":QA+:GR#", b"12:34:56#", 0),
        (b":GR:GD#", b"+45*12:34#", 0),
        (b":GR\x06:GD#", b"P+45*12:34#", 0),
        (b":RS:Mn#", b"", 1),
        (b":Mn:Me#", b"", 1),
        (b":GX80:Mn#", b"", 1),
        (b":QZ-:MS#", b"0", 1),
        (b":Sq:Mn#", b"", 1),
        (b":Sr05:34:32#:Sd+22*00:52#:MS#", b"110", 1),
        (b":Sz 180*00#:Sa+45*00#:MA#", b"110", 1),
        (b":St+45*30#", b"1", 1),
        (b":SL19:00:00#:Mn#", b"1", 1),
        (b":SMa:1#:Mn#", b"1", 1),
        (b":SMa::#:Mn#", b"1", 1),
        (b"#:Q#:Sr05:34:32#", b"1", 1),
        (b":RM#:Mn#:Qn#", b"", 2),
    ],
)
def test_lx200_commands_without_a_hash_mark_are_split_at_the_colon(
    sent: bytes, reply: bytes, moved: int, way: str
) -> None:
    talk = aimed()
    assert say(talk, sent, way) == reply
    assert len(done(talk)) == moved


def test_half_an_lx200_setter_is_dropped_silently_after_5_s() -> None:
    """Its sender has given up, and would take a late 0 for the answer to what it asks next."""
    for late in (b":GR#", b"\x06"):
        talk = aimed()
        assert talk.send(b":Sr07:00:0") == b""
        talk.now += 5
        assert talk.send(late) == {b":GR#": b"12:34:56#", b"\x06": b"P"}[late]
        assert talk.send(b":MS#") == b"1No target set.#"
    talk = aimed()
    assert talk.send(b":Sr07:00:00:MS") == b""
    talk.now += 5
    assert talk.send(b":GR#:MS#") == b"12:34:56#1No target set.#"


def test_half_an_lx200_setter_completed_after_a_pause_is_refused_and_moves_nothing() -> None:
    talk = aimed()
    say(talk, b":Sr07:0")
    talk.now += QUIET
    assert say(talk, b"0:00:MS#:Me#") == b"0" and done(talk) == []


def test_motion_split_by_a_pause_in_an_unterminated_setter_is_ignored() -> None:
    for cut in (b":SMfoo:M", b":SMfoo:"):
        talk = aimed()
        say(talk, cut)
        talk.now += QUIET
        assert say(talk, b"n#") == b"" and done(talk) == []


def test_lx200_setter_may_arrive_in_pieces() -> None:
    talk = aimed()
    assert say(talk, TARGET + b":MS#", "byte by byte", pause=2.0) == b"110"


def test_slowly_typed_lx200_commands_are_framed_one_by_one() -> None:
    talk = aimed()
    assert say(talk, b":Sr07:00:00:MS#", "byte by byte", pause=0.3) == b"1No target set.#"
    assert say(talk, b":SMfoo:Mn#", "byte by byte", pause=0.3) == b""
    assert [type(operation) for operation in done(talk)] == [op.Move]


def test_lx200_framing_marks_unterminated_commands_and_those_behind_them() -> None:
    frames = Lx200Framer().feed(b":GR#:SMfoo:Sr07:00\x06:MS#:Mn#\x06:Q#", 0.0)
    assert frames == [b":GR#", b":SMfoo:Sr07:00:MS#", b":Mn#", b"\x06", b":Q#"]
    assert [type(frame) for frame in frames] == [bytes, Unterminated, Suspect, bytes, Suspect]
    assert Lx200Framer().feed(b":SMa:Mn#:SMb:Me#", 0.0) == [b":SMa:Mn#", b":SMb:Me#"]
    refused = frames[1]
    assert isinstance(refused, Unterminated) and refused.command_names == ("SM", "Sr") and not refused.late
