"""Whole conversations of programs for hand controls, replayed in every way that a wire may deliver them."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from gateway.core import operations as op
from tests.support.conversations import check_whole, degrees, play, receive
from tests.support.each import each
from tests.support.fake_gateway import FakeConnection, FakeGateway
from tests.support.fake_mount import Mount, Talk
from tests.support.transcript_files import files, read

FILES = files("nexstar-*.txt")
WAYS: dict[str, Callable[[bytes], list[bytes]]] = {
    "as typed": lambda packet: [packet],
    "byte by byte": lambda packet: [bytes((byte,)) for byte in packet],
    "with a # behind": lambda packet: [packet + b"#"],
    "with a line end behind": lambda packet: [packet + b"\r\n"],
    "with NULs around": lambda packet: [b"\0", packet, b"\0\0"],
}
#: One byte at 9600 baud.
BYTE = 10 / 9600
PACES: dict[str, Callable[[FakeConnection, bytes], Awaitable[bytes]]] = {
    "whole packets": FakeConnection.ask,
    "a byte at 9600 baud": lambda connection, data: connection.dribble(data, BYTE),
}
MODES = {"0": op.Tracking.OFF, "1": op.Tracking.ALTAZ, "2": op.Tracking.EQ_NORTH, "3": op.Tracking.EQ_SOUTH}


def _set_up(mount: Mount, text: str) -> None:
    """Carry out a ``!`` line."""
    match text.split():
        case ["position", ra, dec]:
            mount.position = op.Equatorial(degrees(ra) * 15, degrees(dec))
        case ["horizontal", az, alt]:
            mount.horizontal = op.Horizontal(float(az), float(alt))
        case ["slewing", value]:
            mount.slewing = value == "1"
        case ["mode", code]:
            mount.status = op.Status(MODES[code], aligned=True, equatorial=MODES[code].equatorial)
        case ["pier", side]:
            mount.pier = side
        case _:
            raise ValueError(text)


@each("way", WAYS)
@each("path", FILES)
def test_nexstar_conversation_gets_the_same_replies_however_bytes_are_cut(path: Path, way: str) -> None:
    conversation = read(path)
    talk = Talk(protocol="nexstar", **conversation.settings)
    play(conversation, talk, WAYS[way], lambda text: _set_up(talk.mount, text))


@pytest.mark.parametrize("ask", PACES.values(), ids=PACES)
@each("path", FILES)
async def test_nexstar_conversation_gets_the_same_replies_beside_other_clients(
    path: Path, ask: Callable[[FakeConnection, bytes], Awaitable[bytes]]
) -> None:
    conversation = read(path)
    gateway = FakeGateway(protocol="nexstar", **conversation.settings)
    await receive(conversation, gateway, ask, lambda text: _set_up(gateway.mount, text))


def test_every_nexstar_program_has_a_recorded_conversation() -> None:
    names = {path.stem.removeprefix("nexstar-") for path in FILES}
    assert names >= {
        "indi-altaz", "indi-german", "indi-guide", "indigo", "indigo-starsense", "stellarium", "stellarium-mobile",
        "skysafari", "ascom", "hamlib", "robustness",
    }  # fmt: skip
    for path in FILES:
        check_whole(path)
