"""Whole conversations of real programs, replayed in every way that a wire may deliver them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from gateway.core import operations as op
from gateway.protocols.base.session import NamedSite, SharedSettings
from tests.support.conversations import check_whole, degrees, play, receive
from tests.support.each import each
from tests.support.fake_gateway import FakeConnection, FakeGateway
from tests.support.fake_mount import Mount, Talk
from tests.support.transcript_files import Conversation, files, read

FILES = files("lx200-*.txt")
WAYS: dict[str, Callable[[bytes], list[bytes]]] = {
    "as typed": lambda packet: [packet],
    "byte by byte": lambda packet: [bytes((byte,)) for byte in packet],
    "with a # behind": lambda packet: [packet + b"#"],
    "the # behind later": lambda packet: [packet, b"#"],
}


def _set_up(mount: Mount, common: SharedSettings, text: str) -> None:
    """Carry out a ``!`` line."""
    match text.split():
        case ["position", ra, dec]:
            mount.position = op.Equatorial(degrees(ra) * 15, degrees(dec))
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


@each("way", WAYS)
@each("path", FILES)
def test_lx200_conversation_gets_the_same_replies_however_bytes_are_cut(path: Path, way: str) -> None:
    conversation = read(path)
    talk = Talk(**_settings(conversation))
    play(conversation, talk, WAYS[way], lambda text: _set_up(talk.mount, talk.session.shared_settings, text))


@each("path", FILES)
async def test_lx200_conversation_gets_the_same_replies_beside_other_clients(path: Path) -> None:
    conversation = read(path)
    gateway = FakeGateway(**_settings(conversation))
    await receive(conversation, gateway, FakeConnection.ask, lambda text: _set_up(gateway.mount, gateway.shared, text))


def test_every_lx200_program_has_a_recorded_conversation() -> None:
    names = {path.stem.removeprefix("lx200-") for path in FILES}
    assert names >= {
        "indi-basic", "indi-autostar", "stellarium", "stellarium-mobile", "skysafari", "sscore", "ascom", "indigo",
        "hamlib", "cartes-du-ciel",
    }  # fmt: skip
    for path in FILES:
        check_whole(path)
