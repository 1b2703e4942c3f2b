"""Framing what LX200 clients send.

Everything before a ``:`` is dropped; ``#`` ends a command; a ``:`` in front of a letter, ``$`` or ``?`` begins a new
one (some programs forget a ``#``); a raw 0x06 is a command of its own, anywhere, and ends a half one. Carriage returns,
line feeds and NULs do not exist. A command longer than 64 bytes is dropped up to the next ``:``.
"""

from __future__ import annotations

ACK = 0x06
LONGEST = 64
_IGNORED = frozenset(b"\r\n\x00")
_COLON, _HASH, _DOLLAR = b":#$"
_BEGINNERS = frozenset(b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz$?")


class Framer:
    """Cuts a byte stream into whole commands, ``b":GR#"``, ``b"$Q#"`` or ``b"\\x06"``."""

    def __init__(self) -> None:
        self._frame = bytearray()
        self._colon = False

    def feed(self, data: bytes) -> list[bytes]:
        """Take bytes as they came -> the commands that are now complete, in order."""
        frames: list[bytes] = []
        for byte in data:
            if byte in _IGNORED:
                continue
            if byte == ACK:
                self._begin()
                frames.append(bytes((ACK,)))
            elif byte == _HASH:
                self._settle_colon()
                if len(self._frame) > 1:
                    frames.append(bytes(self._frame) + b"#")
                self._begin()
            else:
                self._add(byte)
        return frames

    def _begin(self, first: bytes = b"") -> None:
        self._frame = bytearray(first)
        self._colon = False

    def _settle_colon(self) -> None:
        """A colon that was held back was part of the argument after all."""
        if self._colon:
            self._colon = False
            self._take(_COLON)

    def _take(self, byte: int) -> None:
        """One more byte of a command, or the end of one that is too long."""
        self._frame.append(byte)
        if len(self._frame) > LONGEST:
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
                self._begin(b":")
            else:
                self._settle_colon()
        if not self._frame:
            if byte == _DOLLAR:
                self._frame.append(byte)
            return
        if self._frame == b"$" and byte != ord("Q"):
            self._begin(b"$" if byte == _DOLLAR else b"")
            return
        self._take(byte)
