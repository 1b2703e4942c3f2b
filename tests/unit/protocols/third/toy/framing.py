"""Framing of the toy protocol: a command is a line."""

from __future__ import annotations

from gateway.protocols.base.frames import DroppedBytes, Unterminated


class Lines:
    """Cuts a byte stream into lines."""

    holds_bytes = False

    def __init__(self) -> None:
        self._rest = b""
        self.dropped = DroppedBytes()

    @property
    def idle(self) -> bool:
        return not self._rest

    def feed(self, data: bytes, now: float) -> list[bytes]:
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [line + b"\n" for line in lines]

    def end(self) -> list[Unterminated]:
        return []
