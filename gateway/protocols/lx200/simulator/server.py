"""The simulated Meade: a classic LX200 (the 16-inch or a smaller one), an Autostar, an LX200GPS.

It handles bytes at the time that the given clock shows, and never waits. Commands are those of the manual, replies
those that real telescopes were seen to send, with their quirks. Where no source says what a real one does, it assumes:

- Commands that take a real one seconds or minutes (``:SC`` on a classic, ``:Aa`` and ``:gT`` on an LX200GPS) are
  answered late if the caller passes ``send_later``, and nothing else is answered meanwhile; otherwise at once.
- A command with an argument but without ``#`` is refused with everything up to the next ``#``, and no command that
  arrives together with it begins a motion.
- Every model still answers after ``:hP#``, and any motion command but ``:Mg`` unparks the telescope.
- While an LX200GPS sleeps (``:hN#``) it answers as before, but its motors have no power until ``:hW#`` or ``:I#``. It
  accepts ``:MS#`` and ``:MA#`` (``0``) all the same.
- ``:GW#`` reports the mounting, also in land mode (``PN1`` on a wedge; ``AN1`` with ``land_tells_altaz``).
- An argument that is not in the manual's notation is refused and changes nothing, unless the telescope is ``tolerant``.
  Of that notation only the degree sign may vary: ``*``, 0xDF or a colon. Commands beyond the manual are not checked.
- A classic reads a line of 15 seven-bit characters: it sends the degree sign as 0xDF but does not accept that byte.
  Bytes above 0x7F, control characters and a sixteenth character drop the command without a reply.
"""

from __future__ import annotations

import re

from gateway.core.motion_kinds import may_begin_motion
from gateway.protocols.base.frames import Suspect, Unterminated
from gateway.protocols.lx200.framing import ACK, Lx200Framer, setter_name
from gateway.protocols.lx200.simulator import answers, library, motion, settings, tracking
from gateway.protocols.lx200.simulator.telescope import Handler, MeadeTelescope
from gateway.protocols.mechanics.simulated import SendLater
from gateway.protocols.wireformat.command import Command

NAK = b"\x15"
#: The commands that are accepted while the telescope is busy.
ACCEPTED_WHILE_BUSY = frozenset({"Q", "h?", "ACK"})
#: The commands that turn a motor -> the reply of a sleeping telescope.
ASLEEP_REPLY_BY_COMMAND: dict[str, bytes] = {
    **dict.fromkeys(("MS", "MA", "Aa"), b"0"), **dict.fromkeys(("Mn", "Ms", "Me", "Mw", "Mg", "hP", "hS", "hF"), b""),
}  # fmt: skip
HANDLERS: dict[str, Handler] = {
    **answers.HANDLERS, **library.HANDLERS, **motion.HANDLERS, **settings.HANDLERS, **tracking.HANDLERS,
}  # fmt: skip
#: The arguments of commands in exactly the manual's notation.
_DEGREE, _MINUTES = rb"[*\xdf:]", rb"[0-5]\d"
_SECONDS = rb"(?:[:']" + _MINUTES + rb")?"
_DECLINATION = rb"[+-](?:[0-8]\d" + _DEGREE + _MINUTES + _SECONDS + rb"|90" + _DEGREE + rb"00(?:[:']00)?)"
_AZIMUTH = rb"(?:[0-2]\d\d|3[0-5]\d)" + _DEGREE + _MINUTES
_TIME = rb"(?:[01]\d|2[0-3]):" + _MINUTES + rb":" + _MINUTES
_ARGS = {
    "$BA": rb"\d\d", "$BZ": rb"\d\d", "B": rb"\d", "BD": rb"\d|1[0-5]", "F": rb"[1-4]",
    "LC": rb"\d{1,4}", "LM": rb"\d{1,4}", "LS": rb"\d{1,6}", "Lo": rb"\d", "Ls": rb"\d",
    "RA": rb"\d\d[.]\d", "RE": rb"\d\d[.]\d", "Rg": rb"\d\d[.]\d",
    "Sa": _DECLINATION, "Sd": _DECLINATION, "SE": _DECLINATION,
    "St": rb"[+-](?:[0-8]\d" + _DEGREE + _MINUTES + rb"|90" + _DEGREE + rb"00)",
    "Se": rb"[+-](?:0\d\d|1[0-7]\d)" + _DEGREE + _MINUTES + rb"|[+-]180" + _DEGREE + rb"00",
    "Sb": rb"[+-]\d\d[.]\d", "Sf": rb"[+-]\d\d[.]\d", "SB": rb"[1-9]", "SC": rb"\d\d/\d\d/\d\d",
    "SF": rb"\d{3}", "Sl": rb"\d{3}", "Ss": rb"\d{3}", "Sg": _AZIMUTH, "SG": rb"[+-]\d\d[.]\d", "Sh": rb"\d\d",
    "So": rb"\d\d[*\xdf]", "SL": _TIME, "SS": _TIME,
    "Sr": rb"(?:[01]\d|2[0-3]):" + _MINUTES + rb"(?::" + _MINUTES + rb"|[.]\d)",
    "ST": rb"\d{3}[.]\d", "Sw": rb"[2-8]", "Sz": _AZIMUTH + _SECONDS, "T": rb"\d{3}[.]\d{3}", "W": rb"\d",
}  # fmt: skip
_PATTERNS = {name: re.compile(b":" + re.escape(name.encode()) + b"(?:" + form + b")#") for name, form in _ARGS.items()}
MAX_LINE_LENGTH = 15  # characters between the colon and the #
_MIN_COMMAND_BYTE, _MAX_COMMAND_BYTE = 0x20, 0x7F


def is_well_formed(command: str, frame: bytes) -> bool:
    """Whether a whole command is in the manual's notation; True if the notation of this command is not checked."""
    check = _PATTERNS.get(command)
    return check is None or check.fullmatch(frame) is not None


class ClassicFramer(Lx200Framer):
    """Cuts a byte stream into the commands that a classic accepts."""

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """Return the commands that these bytes complete, in order. ``now`` is a monotonic time in seconds."""
        frames: list[bytes] = []
        for byte in data:
            if _MIN_COMMAND_BYTE <= byte <= _MAX_COMMAND_BYTE or byte == ACK:
                frames += super().feed(bytes((byte,)), now)
                if len(self._frame) > MAX_LINE_LENGTH + 1:
                    self._drop()
            else:
                self._drop()
        return frames

    def _drop(self) -> None:
        """Drop an incomplete command; if it had an argument, the commands that arrive with it are suspect."""
        self._is_suspect = self._is_suspect or setter_name(bytes(self._frame)) is not None
        self._begin_command()


class SimulatedLx200(MeadeTelescope):
    """A simulated telescope with its serial port. Raises UserError if the model does not exist."""

    def new_framer(self) -> Lx200Framer:
        return ClassicFramer() if self.classic else Lx200Framer()

    def answer(self, frame: bytes, send_later: SendLater | None) -> bytes:
        if isinstance(frame, Unterminated):
            name = frame.command_names[0]
            return self._deny(self.protocol.commands[name]) if name and self.supports(name) and not frame.late else b""
        match = self.protocol.find(frame)
        if match is None or not self.supports(match[0].name) or match[0].name not in HANDLERS:
            return b""
        command, template = match
        if self.busy and command.name not in ACCEPTED_WHILE_BUSY:
            return NAK if self.model == "lx200gps" else b""
        if isinstance(frame, Suspect) and may_begin_motion(self.protocol.surface_rows[command.name].operations):
            return b""
        if not self.tolerant and not is_well_formed(command.name, frame):
            return self._deny(command)
        try:
            values = template.decode(frame)
        except ValueError:
            return self._deny(command)
        if self.asleep and command.name in ASLEEP_REPLY_BY_COMMAND:
            return ASLEEP_REPLY_BY_COMMAND[command.name]
        reply = HANDLERS[command.name](self, command.name, values) or b""
        return self._split_slow_reply(command.name, reply, send_later)

    @staticmethod
    def _deny(command: Command) -> bytes:
        """Return the reply that refuses an unreadable value of this command; empty if the command has none."""
        refusals = [form for reply, form in command.replies if reply.fault]
        return refusals[0].encode({}) if refusals and not refusals[0].fields else b""

    def _split_slow_reply(self, command: str, reply: bytes, send_later: SendLater | None) -> bytes:
        """Return the part of a slow reply to send at once; pass the rest to ``send_later`` with the seconds to wait."""
        seconds = settings.reply_duration(self, command)
        if send_later is None or not seconds or reply == b"0":
            return reply
        self.busy_until = self.now + seconds
        first, mark, rest = reply.partition(b"#")
        send_later(seconds, rest if mark else first)
        return first + mark if mark else b""
