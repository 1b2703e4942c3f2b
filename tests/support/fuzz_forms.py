"""Judges bytes: is this a reply that the command may have, is this a request that the protocol has?

Replies are checked against the templates of ``commands.toml`` and, on LX200, also against the shapes that were typed
from the manual, which are independent of the product. A verdict is a sentence; an empty one means that all is well.
"""

from __future__ import annotations

import re
from collections import defaultdict

from gateway.protocols.base.frames import Unterminated
from gateway.protocols.wireformat.command import FrameTemplate
from gateway.protocols.wireformat.command_set import CommandSet, load
from tests.support.manual_files import fits, rows

#: Bytes of LX200 replies: printable ASCII, the bar of :D#, the degree sign.
_LX200_BYTES = re.compile(rb"[\x20-\x7f\xdf]*")
_LX200_REQUEST = re.compile(rb"\x06|[:$][\x20-\x22\x24-\x7e\xdf]+#")
#: NexStar settings are acknowledged even if they have no effect.
_ACKNOWLEDGED = b"RrBbSsTWHI"
#: What a StarSense of version 1.20 sends after the tracking mode: its version.
_LONG_MODE = b"\x01\x14#"
#: Shapes that the manual's file leaves out, which has one reply for one state: a refused sync, the target in low
#: precision. And two that the manual does not mention: the refusals of an unknown baud rate and of an impossible
#: tracking rate, which is that of ``:ST#``.
_LX200_ALSO = {"SB": "0", "T": "0", "CM": "#", "Gr": "[0-2][0-9]:[0-5][0-9](:[0-5][0-9]|\\.[0-9])#"}


def _shapes() -> dict[str, list[str]]:
    """Return LX200 command -> the shapes of its replies, typed by hand."""
    shapes: dict[str, list[str]] = defaultdict(list)
    for file in ("lx200_forms.txt", "lx200_beyond.txt"):
        for name, _, _, shape in rows(file):
            shapes[name].append(shape)
    return {name: " ~ ".join([*found, *_LX200_ALSO.get(name, "").split()]) for name, found in shapes.items()}


SHAPES = _shapes()


def _decodes(picture: FrameTemplate, data: bytes) -> bool:
    try:
        picture.decode(data)
    except ValueError:
        return False
    return True


def of_reply(protocol: CommandSet, frame: bytes, reply: bytes) -> str:
    """Return what is wrong with a reply to this command; empty if nothing is."""
    if isinstance(frame, Unterminated):
        forms = protocol.commands[frame.command_names[0]].replies if frame.command_names[0] else []
        refusals = [] if frame.late else [form.wire for form, _ in forms if form.fault]
        return "" if reply.decode() in refusals else f"{reply!r} is no refusal of {frame.command_names[0]!r}"
    found = protocol.find(frame)
    if protocol.name == "nexstar":
        if frame[:1] == b"P" and reply == bytes(frame[7] + 1) + b"#":
            return ""
        if frame[0] in _ACKNOWLEDGED and reply == b"#":
            return ""
        if frame[:1] in (b"M", b"P") and not reply.strip(b"#"):
            return ""  # stops that came together are carried out once and acknowledged in one packet
        if frame == b"t" and reply[1:] == _LONG_MODE:
            return ""
    if found is None:
        return f"a reply to an unknown command: {reply!r}"
    command = found[0]
    if not any(_decodes(picture, reply) for _, picture in command.replies):
        return f"{reply!r} is not a reply form of {command.name}"
    if protocol.name == "lx200":
        if not _LX200_BYTES.fullmatch(reply):
            return f"{reply!r} contains bytes that no LX200 sends"
        if command.name in SHAPES and not fits(reply, SHAPES[command.name]):
            return f"{reply!r} does not have the manual's shape for {command.name}"
    return ""


def of_request(protocol: CommandSet, data: bytes) -> str:
    """Return what is wrong with a request to a mount: it must be one whole command of the protocol, in range."""
    if protocol.name == "lx200" and data[:1] == b"#":  # ends a command that an earlier write may have left incomplete
        return of_request(protocol, data[1:]) if data[1:] else ""
    found = protocol.find(data)
    if found is None or not any(_decodes(picture, data) for picture in found[0].requests):
        return f"the mount was sent {data!r}"
    if protocol.name == "lx200" and not _LX200_REQUEST.fullmatch(data):
        return f"the mount was sent {data!r}"
    return ""


PROTOCOLS = {name: load(name) for name in ("lx200", "nexstar")}
