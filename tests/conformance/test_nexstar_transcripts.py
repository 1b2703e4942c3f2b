"""Whole conversations of programs for hand controls, replayed in every way that a wire may deliver them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.core import operations as op
from tests.support.fake_mount import Mount, Talk
from tests.support.transcript_files import files, read
from tests.support.virtual import run
from tests.support.visits import House

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
MODES = {"0": op.Tracking.OFF, "1": op.Tracking.ALTAZ, "2": op.Tracking.EQ_NORTH, "3": op.Tracking.EQ_SOUTH}


def _degrees(text: str) -> float:
    whole, minutes, seconds = (float(part) for part in text.lstrip("+-").split(":"))
    return (whole + minutes / 60 + seconds / 3600) * (-1 if text.startswith("-") else 1)


def _set_up(mount: Mount, text: str) -> None:
    """Carry out a ``!`` line."""
    match text.split():
        case ["position", ra, dec]:
            mount.position = op.Equatorial(_degrees(ra) * 15, _degrees(dec))
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


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_conversation(path: Path, way: str) -> None:
    conversation = read(path)
    talk = Talk(protocol="nexstar", **conversation.settings)
    heard = b""
    for line in conversation.lines:
        if line.mark == ">":
            heard += b"".join(talk.send(chunk) for chunk in WAYS[way](line.data))
        elif line.mark == "<":
            assert heard == line.data, f"{path.name}:{line.number}"
            heard = b""
        elif line.mark == "@":
            talk.wait(float(line.text))
        else:
            _set_up(talk.mount, line.text)
    assert heard == b""


@pytest.mark.parametrize("pace", ["whole packets", "a byte at 9600 baud"])
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_conversation_through_the_reception(path: Path, pace: str) -> None:
    """The same with the product's own clients, which answer in their own time."""
    run(_received(path, pace))


async def _received(path: Path, pace: str) -> None:
    conversation = read(path)
    house = House(protocol="nexstar", **conversation.settings)
    visit, heard = house.visit(), b""
    for line in conversation.lines:
        if line.mark == ">":
            heard += await (visit.ask(line.data) if pace == "whole packets" else visit.dribble(line.data, BYTE))
        elif line.mark == "<":
            assert heard == line.data, f"{path.name}:{line.number}"
            heard = b""
        elif line.mark == "@":
            await asyncio.sleep(float(line.text))
        else:
            _set_up(house.mount, line.text)
            house.controller.changed()
    assert heard == b""


def test_there_is_a_conversation_for_every_program() -> None:
    names = {path.stem.removeprefix("nexstar-") for path in FILES}
    assert names >= {
        "indi-altaz",
        "indi-german",
        "indi-guide",
        "indigo",
        "indigo-starsense",
        "stellarium",
        "stellarium-mobile",
        "skysafari",
        "ascom",
        "hamlib",
        "robustness",
    }
    for path in FILES:
        lines = read(path).lines
        assert [line.mark for line in lines].count("<") > 4
        assert lines[-1].mark == "<", f"{path.name} ends before its last reply"
