"""Whole conversations of real programs, replayed in every way that a wire may deliver them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.protocols.base.session import NamedSite, Shared
from tests.support.fake_mount import Mount, Talk
from tests.support.transcript_files import Conversation, files, read
from tests.support.virtual import run
from tests.support.visits import House

FILES = files("lx200-*.txt")
WAYS: dict[str, Callable[[bytes], list[bytes]]] = {
    "as typed": lambda packet: [packet],
    "byte by byte": lambda packet: [bytes((byte,)) for byte in packet],
    "with a # behind": lambda packet: [packet + b"#"],
    "the # behind later": lambda packet: [packet, b"#"],
}


def _degrees(text: str) -> float:
    whole, minutes, seconds = (float(part) for part in text.lstrip("+-").split(":"))
    return (whole + minutes / 60 + seconds / 3600) * (-1 if text.startswith("-") else 1)


def _set_up(mount: Mount, common: Shared, text: str) -> None:
    """Carry out a ``!`` line."""
    match text.split():
        case ["position", ra, dec]:
            mount.position = op.Equatorial(_degrees(ra) * 15, _degrees(dec))
        case ["slewing", value]:
            mount.slewing = value == "1"
        case ["ack", "A"]:
            mount.status = op.Status(op.Tracking.ALTAZ, aligned=True, equatorial=False)
        case ["site-name", name]:
            common.settings = common.settings.with_site(0, NamedSite(name))
        case _:
            raise ValueError(text)


def _settings(talk: Conversation) -> dict[str, Any]:
    return {name: value for name, value in talk.settings.items() if name != "connections"}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_conversation(path: Path, way: str) -> None:
    conversation = read(path)
    talk = Talk(**_settings(conversation))
    heard = b""
    for line in conversation.lines:
        if line.mark == ">":
            if "connections" in conversation.settings:
                talk.reconnect()
            heard += b"".join(talk.send(chunk) for chunk in WAYS[way](line.data))
        elif line.mark == "<":
            assert heard == line.data, f"{path.name}:{line.number}"
            heard = b""
        elif line.mark == "@":
            talk.wait(float(line.text))
        else:
            _set_up(talk.mount, talk.session.common, line.text)
    assert heard == b""


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_conversation_through_the_reception(path: Path) -> None:
    """The same with the product's own clients, and connections that come and go where the program does that."""
    run(_received(path, read(path)))


async def _received(path: Path, conversation: Conversation) -> None:
    house = House(**_settings(conversation))
    visit, heard = house.visit(), b""
    for line in conversation.lines:
        if line.mark == ">":
            if "connections" in conversation.settings:
                visit.close()
                visit = house.visit()
            heard += await visit.ask(line.data)
        elif line.mark == "<":
            assert heard == line.data, f"{path.name}:{line.number}"
            heard = b""
        elif line.mark == "@":
            await asyncio.sleep(float(line.text))
        else:
            _set_up(house.mount, house.shared, line.text)
            house.controller.changed()
    assert heard == b""


def test_there_is_a_conversation_for_every_program() -> None:
    names = {path.stem.removeprefix("lx200-") for path in FILES}
    assert names >= {
        "indi-basic",
        "indi-autostar",
        "stellarium",
        "stellarium-mobile",
        "skysafari",
        "sscore",
        "ascom",
        "indigo",
        "hamlib",
        "cartes-du-ciel",
    }
    for path in FILES:
        lines = read(path).lines
        assert [line.mark for line in lines].count("<") > 4
        assert lines[-1].mark == "<", f"{path.name} ends before its last reply"
