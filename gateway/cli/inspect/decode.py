"""``decode``: a recording, or a raw capture of a serial line, as a conversation in words."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from gateway.cli.help import Commands
from gateway.core.errors import UserError
from gateway.protocols.registry import PROTOCOLS, guess
from gateway.system import streams


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
    from gateway.app.bindings import speech
    from gateway.diagnostics.captures import Capture, is_text
    from gateway.diagnostics.decode import NoConversation, decode, folded
    from gateway.diagnostics.recorded_sides import RecordedSides

    streams.tolerate()
    path = arguments.file
    capture = Capture(path)
    recording = capture.recording
    sides, protocol, began = None, arguments.protocol, None
    if recording is not None:
        sides, began = RecordedSides(recording), recording.settings["began"]
    else:
        sample = capture.sample()
        if capture.bare and not arguments.protocol and is_text(sample):
            raise UserError(
                f"{path}: this is text, and no capture of a serial line; decode reads recordings of "
                "run --record, pyserial's spy://, socat -x, and the bare bytes that a client sent "
                "(with --protocol whatever they look like)"
            )
        protocol = protocol or guess(sample)
        if protocol is None:
            raise UserError(f"{path}: nothing in it was sent by a client; name the protocol with --protocol")

    def talk(side: str) -> tuple[str, Any, Any]:
        spoken = protocol if sides is None else sides.protocol(side)
        return spoken, *speech(spoken)

    lines = decode(capture if sides is None else sides.introduced(capture), talk, began)
    try:
        for line in folded(lines) if capture.bare else lines:
            print(line)
    except NoConversation as error:
        raise UserError(f"{path}: {error}") from None
    if recording is not None and recording.cut:
        print(recording.cut)
    return 0
