"""``decode``: a recording, or a raw capture of a serial line, as a conversation in words."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.help import Commands
from gateway.core.errors import UserError
from gateway.protocols.registry import PROTOCOLS, guess
from gateway.system import streams

if TYPE_CHECKING:
    from gateway.diagnostics.captures import Capture


def add(commands: Commands) -> None:
    decode = commands.add_parser(
        "decode",
        help="a recording or a capture of a serial line, in words",
        description="Understands recordings of run --record, pyserial's spy://, socat -x, "
        "and the bare bytes that a client sent.",
        epilog="Example:\n  mount-gateway decode night.rec | less",
    )
    decode.add_argument("file", type=Path, metavar="FILE")
    decode.add_argument("--protocol", choices=tuple(PROTOCOLS), help="of a capture; without it, it is guessed")
    decode.set_defaults(run=_decode)


def _decode(arguments: argparse.Namespace) -> int:
    from gateway.diagnostics.captures import Capture
    from gateway.diagnostics.decode import NoConversation, decode, folded
    from gateway.diagnostics.log.conversation import Side
    from gateway.diagnostics.recorded_sides import RecordedSides

    streams.tolerate()
    path = arguments.file
    capture = Capture(path)
    recording = capture.recording
    if recording is not None:
        sides = RecordedSides(recording)
        lines = decode(sides.introduced(capture), sides.side, recording.settings["began"])
    else:
        protocol = arguments.protocol or _guessed(capture, path)
        lines = decode(capture, lambda side: Side(protocol), None)
    try:
        for line in folded(lines) if capture.bare else lines:
            print(line)
    except NoConversation as error:
        raise UserError(f"{path}: {error}") from None
    if recording is not None and recording.cut:
        print(recording.cut)
    return 0


def _guessed(capture: Capture, path: Path) -> str:
    """The protocol of a capture, by what a client sent in it. Raises UserError."""
    from gateway.diagnostics.captures import is_text

    sample = capture.sample()
    if capture.bare and is_text(sample):
        raise UserError(
            f"{path}: this is text, and no capture of a serial line; decode reads recordings of "
            "run --record, pyserial's spy://, socat -x, and the bare bytes that a client sent "
            "(with --protocol whatever they look like)"
        )
    protocol = guess(sample)
    if protocol is None:
        raise UserError(f"{path}: nothing in it was sent by a client; name the protocol with --protocol")
    return protocol
