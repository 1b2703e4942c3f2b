"""``decode``: a recording, or a raw capture of a serial line, as a conversation in words."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from gateway.errors import UserError


def add(commands: Any) -> None:
    """Put the command into the parser."""
    decode = commands.add_parser("decode", help="a recording or a capture of a serial line, in words",
                                 description="Understands recordings of run --record, pyserial's spy://, socat -x, "
                                 "and the bare bytes that a client sent.",
                                 epilog="Example:\n  mount-gateway decode night.rec | less")
    decode.add_argument("file", type=Path, metavar="FILE")
    decode.add_argument("--protocol", choices=("lx200", "nexstar"), help="of a capture; without it, it is guessed")
    decode.set_defaults(run=_decode)


def _decode(arguments: argparse.Namespace) -> int:
    from gateway.assembly import DRIVERS, FACES
    from gateway.captures import chunks
    from gateway.config import Endpoint, MountConfig, SurfaceConfig, parse_endpoint
    from gateway.decode import decode, guess
    from gateway.recording import MOUNT, is_recording, read
    from gateway.safety import Limits

    path = arguments.file
    found = chunks(path)
    protocols: dict[str, str] = {}
    began = None
    if is_recording(path):
        settings = read(path).settings
        began = settings["began"]
        protocols[MOUNT] = parse_endpoint(settings["config"]["mount"]["at"]).protocol
        surfaces = [parse_endpoint(surface["at"]).protocol for surface in settings["config"]["surface"]]
        for chunk in found:
            if chunk.arrow == "+":
                number = int(chunk.data.split(b",")[0].split()[-1])
                protocols[chunk.side] = surfaces[number - 1]
    else:
        protocol = arguments.protocol or guess(found)
        if protocol is None:
            raise UserError(f"{path}: nothing in it was sent by a client; name the protocol with --protocol")
        protocols["client"] = protocol

    def talk(side: str) -> tuple[str, Any, Any]:
        protocol = protocols.get(side, protocols.get(MOUNT, "lx200"))
        face = FACES[protocol](Endpoint(protocol, "-"), SurfaceConfig(at="-"), Limits())
        dialogue = DRIVERS[protocol](Endpoint(protocol, "-"), MountConfig(at="-"), time.monotonic)[2]
        return protocol, face.framing, dialogue

    print("\n".join(decode(found, talk, began)))
    return 0
