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
- An argument that the manual does not write so is refused and changes nothing. A ``tolerant`` one takes every spelling
  that the gateway's own surface takes.
"""

from __future__ import annotations

from gateway.core.motion_kinds import may_begin_motion
from gateway.protocols.base.frames import Suspect, Unterminated
from gateway.protocols.lx200.framing import Framer
from gateway.protocols.lx200.simulator import answers, library, motion, parts, settings, tracking
from gateway.protocols.lx200.simulator.forms import well_formed
from gateway.protocols.lx200.simulator.line import ClassicFramer
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
    **answers.HANDLERS, **library.HANDLERS, **motion.HANDLERS, **parts.HANDLERS,
    **settings.HANDLERS, **tracking.HANDLERS,
}  # fmt: skip


class SimulatedLx200(Telescope):
    """A simulated telescope that listens to its serial port. Raises UserError for a model that does not exist."""

    def framer(self) -> Framer:
        return ClassicFramer() if self.classic else Framer()

    def _answer(self, frame: bytes, later: Later | None) -> bytes:
        if isinstance(frame, Unterminated):
            name = frame.names[0]
            return self._no(self.protocol.commands[name]) if name and self.knows(name) and not frame.late else b""
        found = self.protocol.find(frame)
        if found is None or not self.knows(found[0].name):
            return b""
        command, picture = found
        if self.busy and command.name not in WHILE_BUSY:
            return NAK if self.model == "lx200gps" else b""
        if isinstance(frame, Suspect) and may_begin_motion(self.protocol.surface[command.name].operations):
            return b""
        if not self.tolerant and not well_formed(command.name, frame):
            return self._no(command)
        try:
            values = picture.decode(frame)
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
