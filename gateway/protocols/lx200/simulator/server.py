"""The simulated Meade: a classic LX200 under or at 16 inches, an Autostar, an LX200GPS.

Bytes in, bytes out, at the time that the given clock shows; nothing sleeps. What it knows is what the manual gives that
model, what it answers is what real ones were seen to answer, quirks included. Where nobody has said:

- What takes a real one seconds or minutes (``:SC`` on a classic, ``:Aa`` and ``:gT`` on an LX200GPS) is answered late,
  and nothing else meanwhile, to a caller that gave ``later``; to any other it is done at once.
- A command with an argument that lost its ``#`` is refused with everything up to the next one, and nothing that comes
  with it sets the telescope moving.
- It answers after ``:hP#`` on every model, and any motion command takes a parked telescope into service.
- While an LX200GPS sleeps (``:hN#``) it answers as before, but its motors have no power: nothing turns until ``:hW#``
  or ``:I#``. It says yes (``0``) to ``:MS#`` and ``:MA#`` all the same.
- ``:GW#`` tells how the telescope stands, in land mode too (``PN1`` on a wedge). With ``land_tells_altaz`` it tells
  ``AN1`` there instead: nobody has seen what a real one does.
- An argument that the manual does not write so is refused and changes nothing: other telescopes that speak this
  protocol refuse it and keep what they had, and a driver that is tested against a lenient one never learns of it. Alone
  the degree sign may be ``*``, the byte 0xDF or a colon, which programs have sent to real telescopes for decades.
  Commands beyond the manual are not looked at. A ``tolerant`` one takes every spelling that the gateway's own surface
  takes.
- A classic reads a line of 15 characters of seven bits, and has no patience: its degree sign goes out as 0xDF and must
  not come back in. Bytes above 0x7F, control characters and a sixteenth character drop the command they stand in,
  without a word.
"""

from __future__ import annotations

import re

from gateway.core.motion_kinds import may_begin_motion
from gateway.protocols.base.frames import Suspect, Unterminated
from gateway.protocols.lx200.framing import ACK, Framer, setter
from gateway.protocols.lx200.simulator import answers, library, motion, settings, tracking
from gateway.protocols.lx200.simulator.telescope import Handler, Telescope
from gateway.protocols.mechanics.simulated import Later
from gateway.protocols.wireformat.command import Command

NAK = b"\x15"
#: What is understood while the telescope is busy with itself.
WHILE_BUSY = frozenset({"Q", "h?", "ACK"})
#: What turns a motor -> the answer of one whose motors have no power, because it sleeps.
TURNS_MOTORS: dict[str, bytes] = {
    **dict.fromkeys(("MS", "MA", "Aa"), b"0"), **dict.fromkeys(("Mn", "Ms", "Me", "Mw", "Mg", "hP", "hS", "hF"), b""),
}  # fmt: skip
HANDLERS: dict[str, Handler] = {
    **answers.HANDLERS, **library.HANDLERS, **motion.HANDLERS, **settings.HANDLERS, **tracking.HANDLERS,
}  # fmt: skip
#: How the manual writes the arguments of its commands, and nothing else.
_DEGREE, _MINUTES = rb"[*\xdf:]", rb"[0-5]\d"
_SECONDS = rb"(?:[:']" + _MINUTES + rb")?"
_NINETY = rb"[+-](?:[0-8]\d" + _DEGREE + _MINUTES + _SECONDS + rb"|90" + _DEGREE + rb"00(?:[:']00)?)"
_TURN = rb"(?:[0-2]\d\d|3[0-5]\d)" + _DEGREE + _MINUTES
_TIME = rb"(?:[01]\d|2[0-3]):" + _MINUTES + rb":" + _MINUTES
_FORMS = {
    "$BA": rb"\d\d", "$BZ": rb"\d\d", "B": rb"\d", "BD": rb"\d|1[0-5]", "F": rb"[1-4]",
    "LC": rb"\d{1,4}", "LM": rb"\d{1,4}", "LS": rb"\d{1,6}", "Lo": rb"\d", "Ls": rb"\d",
    "RA": rb"\d\d[.]\d", "RE": rb"\d\d[.]\d", "Rg": rb"\d\d[.]\d",
    "Sa": _NINETY, "Sd": _NINETY, "SE": _NINETY,
    "St": rb"[+-](?:[0-8]\d" + _DEGREE + _MINUTES + rb"|90" + _DEGREE + rb"00)",
    "Se": rb"[+-](?:0\d\d|1[0-7]\d)" + _DEGREE + _MINUTES + rb"|[+-]180" + _DEGREE + rb"00",
    "Sb": rb"[+-]\d\d[.]\d", "Sf": rb"[+-]\d\d[.]\d", "SB": rb"[1-9]", "SC": rb"\d\d/\d\d/\d\d",
    "SF": rb"\d{3}", "Sl": rb"\d{3}", "Ss": rb"\d{3}", "Sg": _TURN, "SG": rb"[+-]\d\d[.]\d", "Sh": rb"\d\d",
    "So": rb"\d\d[*\xdf]", "SL": _TIME, "SS": _TIME,
    "Sr": rb"(?:[01]\d|2[0-3]):" + _MINUTES + rb"(?::" + _MINUTES + rb"|[.]\d)",
    "ST": rb"\d{3}[.]\d", "Sw": rb"[2-8]", "Sz": _TURN + _SECONDS, "T": rb"\d{3}[.]\d{3}", "W": rb"\d",
}  # fmt: skip
_CHECKS = {name: re.compile(b":" + re.escape(name.encode()) + b"(?:" + form + b")#") for name, form in _FORMS.items()}
LINE = 15  # characters between the colon and the #
_LOWEST, _HIGHEST = 0x20, 0x7F


def well_formed(name: str, frame: bytes) -> bool:
    """Whether a whole command is written as the manual writes it."""
    check = _CHECKS.get(name)
    return check is None or check.fullmatch(frame) is not None


class ClassicFramer(Framer):
    """Cuts a byte stream into the commands that a classic would understand."""

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """Take bytes as they came -> the commands that are now complete, in order. ``now``: any clock, in seconds."""
        frames: list[bytes] = []
        for byte in data:
            if _LOWEST <= byte <= _HIGHEST or byte == ACK:
                frames += super().feed(bytes((byte,)), now)
                if len(self._frame) > LINE + 1:
                    self._drop()
            else:
                self._drop()
        return frames

    def _drop(self) -> None:
        """Forget half a command; what comes with one that had an argument is suspect all the same."""
        self._suspect = self._suspect or setter(bytes(self._frame)) is not None
        self._begin()


class SimulatedLx200(Telescope):
    """A simulated telescope that listens to its serial port. Raises UserError for a model that does not exist."""

    def framer(self) -> Framer:
        return ClassicFramer() if self.classic else Framer()

    def _answer(self, frame: bytes, later: Later | None) -> bytes:
        if isinstance(frame, Unterminated):
            name = frame.names[0]
            return self._no(self.protocol.commands[name]) if name and self.supports(name) and not frame.late else b""
        found = self.protocol.find(frame)
        if found is None or not self.supports(found[0].name):
            return b""
        command, template = found
        if self.busy and command.name not in WHILE_BUSY:
            return NAK if self.model == "lx200gps" else b""
        if isinstance(frame, Suspect) and may_begin_motion(self.protocol.surface[command.name].operations):
            return b""
        if not self.tolerant and not well_formed(command.name, frame):
            return self._no(command)
        try:
            values = template.decode(frame)
        except ValueError:
            return self._no(command)
        if self.asleep and command.name in TURNS_MOTORS:
            return TURNS_MOTORS[command.name]
        reply = HANDLERS[command.name](self, command.name, values) or b""
        return self._take_time(command.name, reply, later)

    @staticmethod
    def _no(command: Command) -> bytes:
        """What it says to a value that it cannot read, where it says anything."""
        refusals = [form for reply, form in command.replies if reply.fault]
        return refusals[0].encode({}) if refusals and not refusals[0].fields else b""

    def _take_time(self, name: str, reply: bytes, later: Later | None) -> bytes:
        """Of a reply that takes its time, what comes at once; the rest follows when the telescope is free again."""
        seconds = settings.takes(self, name)
        if later is None or not seconds or reply == b"0":
            return reply
        self.busy_until = self.now + seconds
        first, mark, rest = reply.partition(b"#")
        later(seconds, rest if mark else first)
        return first + mark if mark else b""
