"""Framing what LX200 clients send.

Everything before a ``:`` is dropped; ``#`` ends a command; a ``:`` in front of a letter, ``$`` or ``?`` begins a new
one (some programs forget a ``#``); a raw 0x06 is a command of its own, anywhere, and ends a half one. Carriage returns,
line feeds and NULs do not exist. A command longer than 64 bytes is dropped up to the next ``:``.

A command with an argument that lost its ``#`` is another matter: the ``:MS#`` behind half a ``:Sr`` would go to the
target before. It is refused with everything up to the next ``#``, and what follows is suspect until the line has been
quiet for a tenth of a second; a stop among all that is handed on as ever. Where the pause came before the new command,
the half one is dropped alone.
"""

from __future__ import annotations

from functools import cache

from gateway.protocols.base.frames import Dropped, Suspect, Unterminated
from gateway.protocols.wireformat.command_set import load

ACK = 0x06
LONGEST = 64
#: Seconds of quiet that end a run of bytes: what comes then has nothing to do with what came before.
RUN_GAP = 0.1
#: Why bytes are of no use.
NOISE = "no command of an LX200 begins so"
HALF = "a command without its end (#)"
TOO_LONG = "longer than any command of an LX200"
_IGNORED = frozenset(b"\r\n\x00")
_COLON, _HASH, _DOLLAR = b":#$"
_BEGINNERS = frozenset(b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz$?")


def setter(begun: bytes) -> str | None:
    """The command with an argument that these bytes begin, "" for a ``:S`` command that nobody knows, else None."""
    command = load("lx200").begun(begun)
    if command is not None:
        return command.name if command.request.fields else None
    return "" if begun.startswith(b":S") else None


@cache
def stops() -> tuple[bytes, ...]:
    """What is carried out wherever it stands: what ends something and does nothing else."""
    commands = load("lx200").commands.values()
    return tuple([command.request.prefix for command in commands if command.urgent in ("stop", "axis", "part")])


class Framer:
    """Cuts a byte stream into whole commands, ``b":GR#"``, ``b"$Q#"`` or ``b"\x06"``."""

    def __init__(self) -> None:
        self._frame = bytearray()
        self._colon = False
        self._heard = 0.0
        #: The half command is from before the last quiet.
        self._old = False
        #: What lost its end, with all that is swallowed behind it, and the names of the commands in it.
        self._lost: dict[str, None] = {}
        self._text = bytearray()
        #: Whatever comes in this run is.
        self._suspect = False
        self._frames: list[bytes] = []
        self.dropped = Dropped()

    @property
    def idle(self) -> bool:
        """Whether the next byte begins a command, whatever came before."""
        return not (self._frame or self._suspect)

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """Take bytes as they came -> the commands that are now complete, in order. ``now``: any clock, in seconds."""
        if not data:
            return []
        self._frames = []
        self.dropped.clear()
        quiet, self._heard = now - self._heard, now
        if quiet >= RUN_GAP:
            self._begin_run()
        for byte in data:
            if byte in _IGNORED:
                continue
            if byte == ACK:
                self._cut()
                if not self._lost:
                    self._frames.append(bytes((ACK,)))
                self._begin()
            elif byte == _HASH:
                self._settle_colon()
                self._end()
            else:
                self._add(byte)
        return self._frames

    def _begin(self, first: bytes = b"") -> None:
        self._frame = bytearray(first)
        self._colon = self._old = False

    def _begin_run(self) -> None:
        """It was quiet: nothing is suspect any more, and of what was swallowed only a stop may go on."""
        self._suspect = False
        self._old = bool(self._frame)
        if self._lost:
            rest = b":" if self._colon else bytes(self._frame)
            self._give_up()
            self._begin(rest if any(stop.startswith(rest) for stop in stops()) else b"")

    def _give_up(self) -> None:
        """What was swallowed comes to no end any more."""
        self._swallow(bytes(self._frame), setter(bytes(self._frame)))
        self._frames.append(Unterminated(bytes(self._text), tuple(self._lost), late=True))
        self._lost = {}

    def end(self) -> list[Unterminated]:
        """Nothing more comes -> half a command with an argument, which must not count as the one before it."""
        self._frames, self._old = [], True
        self.dropped.clear()
        if self._lost:
            self._give_up()
        else:
            self._cut()
        self._begin()
        return [frame for frame in self._frames if isinstance(frame, Unterminated)]

    def _cut(self, why: str = HALF) -> None:
        """Something else begins here: a command with an argument has lost its end, any other is dropped."""
        piece = bytes(self._frame)
        name = setter(piece) if len(piece) > 1 else None
        if self._lost:
            self._swallow(piece, name)
            if piece + b"#" in stops():
                self._frames.append(piece + b"#")
        elif name is not None and self._old:
            self._frames.append(Unterminated(piece, (name,), late=True))
        elif name is not None:
            self._text.clear()
            self._suspect = True
            self._swallow(piece, name)
        elif len(piece) > 1:
            self.dropped.add(piece, why)

    def _swallow(self, piece: bytes, name: str | None) -> None:
        """Keep what comes to an end that is not its own: enough of it for the log, and all that it would have set."""
        self._text += piece[: LONGEST - len(self._text)]
        if name is not None:
            self._lost[name] = None

    def _end(self) -> None:
        """The end of a command, or of all that was swallowed."""
        frame = bytes(self._frame) + b"#"
        if self._lost:
            self._swallow(frame[:-1], setter(frame[:-1]))
            self._frames.append(Unterminated(bytes(self._text) + b"#", tuple(self._lost)))
            self._lost = {}
            if frame in stops():
                self._frames.append(frame)
        elif len(frame) > 2:
            self._frames.append(Suspect(frame) if self._suspect else frame)
        self._begin()

    def _settle_colon(self) -> None:
        """A colon that was held back was part of the argument after all."""
        if self._colon:
            self._colon = False
            self._take(_COLON)

    def _take(self, byte: int) -> None:
        """One more byte of a command, or the end of one that is too long."""
        self._frame.append(byte)
        self._old = False
        if len(self._frame) > LONGEST:
            self._cut(TOO_LONG)
            self._begin()

    def _add(self, byte: int) -> None:
        if byte == _COLON:
            if len(self._frame) > 1:
                self._settle_colon()
                self._colon = True  # an argument's separator, or the next command: the next byte tells
            else:
                self._begin(b":")
            return
        if self._colon:
            if byte in _BEGINNERS:
                self._cut()
                self._begin(b":")
            else:
                self._settle_colon()
        if not self._frame:
            if byte == _DOLLAR:
                self._frame.append(byte)
            else:
                self.dropped.add(bytes((byte,)), NOISE)
            return
        if self._frame == b"$" and byte != ord("Q"):
            self.dropped.add(b"$" if byte == _DOLLAR else bytes((_DOLLAR, byte)), NOISE)
            self._begin(b"$" if byte == _DOLLAR else b"")
            return
        self._take(byte)
