"""A simulated Celestron hand control on its mount: bytes of the serial port in, bytes out.

It answers like the chosen model and version, at the present time of its clock; the caller that transports the bytes
adds delays. A command that this version lacks is read in full, by its length in other versions, and ignored. After a
byte that begins no command it ignores everything until the line has been quiet for 0.1 s.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from gateway.protocols.mechanics.simulated import SendLater, TimedFramer
from gateway.protocols.nexstar.framing import NexStarFramer
from gateway.protocols.nexstar.simulator.commands import HANDLER_BY_COMMAND
from gateway.protocols.nexstar.simulator.devices import HANDLER_BY_REQUEST
from gateway.protocols.nexstar.simulator.mount import Handler, SimulatedMount
from gateway.protocols.nexstar.versions import STARSENSE_LONG_MODE
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Version

HANDLERS: dict[str, Handler] = {**HANDLER_BY_COMMAND, **HANDLER_BY_REQUEST}
#: The first bytes of the commands that are answered in hibernation.
ANSWERED_ASLEEP = b"yKV"
PASS_THROUGH = ord("P")


class SimulatedHandControl(SimulatedMount):
    """A simulated mount with a serial port. Raises UserError for an unknown model or an invalid version."""

    def __init__(self, model: str = "6-8se", version: str | None = None, **settings: Any) -> None:
        super().__init__(model, version, **settings)
        self._opcodes, self._pass_through = _known_commands(model, self.version)

    def new_framer(self) -> NexStarFramer:
        return NexStarFramer(drops_late_ends=False)

    def feed(self, data: bytes, framer: TimedFramer | None = None, send_later: SendLater | None = None) -> bytes:
        """Like ``Simulated.feed``; also note when bytes arrived last. ``send_later`` is never used."""
        self.advance_to_now()
        if data:
            self.last_byte_at = self.now
        return super().feed(data, framer, send_later)

    def answer(self, frame: bytes, send_later: SendLater | None) -> bytes:
        if frame[0] not in self._opcodes or (self.asleep and frame[0] not in ANSWERED_ASLEEP):
            return b""
        if frame[0] == PASS_THROUGH:
            return self._pass_to_device(frame)
        match = self.command_set.find(frame)
        try:
            if match is None:
                raise ValueError(f"{frame!r} has the length of a command but not its form")
            command, template = match
            if command.name not in HANDLERS:
                return b""
            values = HANDLERS[command.name](self, template.decode(frame)) or {}
        except ValueError:
            return b"#"  # acknowledged but not carried out
        if command.name == "t" and self.starsense and self.reported_version == STARSENSE_LONG_MODE:
            return bytes((values["mode"], *self.reported_version)) + b"#"
        form = command.reply_form(self.facts.get("dialect"))
        return b"" if form is None else form.encode(values)

    def _pass_to_device(self, frame: bytes) -> bytes:
        """``P``: return the device's answer, cut or padded to the requested length; without an answer one byte more."""
        count, device, number, asked = frame[1], frame[2], frame[3], frame[7]
        table = self._pass_through
        rows = table.get((count, device, number)) or table.get((count, None, number))
        if rows and self.has_device(device):
            command, reply_length = next((row for row in rows if row[1] == asked), rows[0])
            data = frame[4 : 3 + count]
            values = command.request.decode(frame[:4] + data + bytes(3 - len(data)) + bytes((reply_length,)))
            handler = HANDLERS.get(command.name)
            if handler is not None and (answer := handler(self, {**values, "device": device})) is not None:
                return (command.replies[0][1].encode(answer)[:-1] + bytes(asked))[:asked] + b"#"
        return bytes(asked + 1) + b"#"


#: (length, device or None for any, command number) -> pass-through commands, each with its number of reply bytes.
PassThrough = dict[tuple[int, int | None, int], list[tuple[Command, int]]]


@cache
def _known_commands(model: str, version: Version) -> tuple[frozenset[int], PassThrough]:
    """Return the first bytes of the commands that a model of this version has, and its pass-through commands."""
    known = [row for row in load("nexstar").commands.values() if row.exists_on(model, version)]
    return frozenset(row.request.prefix[0] for row in known), _group_by_device(known)


def _group_by_device(known: list[Command]) -> PassThrough:
    """Return the pass-through commands by length, device and command number, the bytes that identify them."""
    commands: PassThrough = {}
    for command in known:
        if command.request.prefix[0] == PASS_THROUGH:
            frame = command.request.encode(dict.fromkeys(command.request.fields, 0))
            device = None if "device" in command.request.fields else frame[2]
            commands.setdefault((frame[1], device, frame[3]), []).append((command, frame[7]))
    return commands
