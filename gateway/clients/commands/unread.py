"""Holds back the part of a reply that some programs leave unread on a network connection.

INDI's LX200 drivers read one byte of ``1Object Below Horizon.#``, and discard the rest in a way that has no effect on a
socket. They would take the text for the reply to their next question, and stay one reply behind from then on. So the
text waits: it is dropped at the next command, and sent after ``HOLD_TIME`` seconds to a program that reads on. A
program that begins with a ``#`` is none of those drivers and gets its replies whole.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from gateway.core.wire_log import ClientLog

#: Seconds: longer than those drivers wait before they ask anew (they poll each second), and shorter than any program
#: waits for the rest of a reply (3 s).
HOLD_TIME = 1.2
#: Seconds more, so that a question that has arrived while this computer was busy is read before the text is sent.
SETTLE_TIME = 0.02
#: Bytes that ask for nothing.
_IGNORED_BYTES = b"#\r\n\0 "


class UnreadText:
    """The text that waits on a connection. ``send_bytes`` sends and logs bytes; ``hold`` of 0 s holds nothing back."""

    def __init__(
        self, send_bytes: Callable[[bytes], None], log: ClientLog, loop: asyncio.AbstractEventLoop, hold: float
    ) -> None:
        self._send_bytes, self._log, self._loop, self.hold_time = send_bytes, log, loop, hold
        self._held_text = b""
        self._timer: asyncio.TimerHandle | None = None

    def heard(self, data: bytes) -> None:
        """The program has sent bytes: it does not wait for the text."""
        if data[:1] == b"#" and len(data) > 1:
            self.whole()
        if data.strip(_IGNORED_BYTES):
            self.drop()

    def drop(self) -> None:
        """Drop the waiting text: the program has sent another command, or has gone."""
        if text := self._remove_text():
            self._log.put("x", text, "not sent, because the program did not wait for it")

    def read_part(self, reply: bytes, byte_count: int, more: bool) -> bytes:
        """Return the part of a reply to send now: the first ``byte_count`` bytes.

        ``more``: further commands wait already, so the program does not wait between the bytes of this reply; if some
        programs read nothing of it, it reads nothing.
        """
        if len(reply) <= byte_count or (more and byte_count):
            return reply
        self._held_text = reply[byte_count:]
        if more:
            self.drop()
        elif self.hold_time != float("inf"):
            self._timer = self._loop.call_later(self.hold_time, self._settle)
        return reply[:byte_count]

    def _settle(self) -> None:
        self._timer = self._loop.call_later(SETTLE_TIME, self._release)

    def _release(self) -> None:
        if text := self._remove_text():
            self._send_bytes(text)

    def whole(self) -> None:
        """Send the waiting text, and hold nothing back from now on."""
        self._release()
        self.hold_time = 0.0

    def _remove_text(self) -> bytes:
        text, self._held_text = self._held_text, b""
        if self._timer is not None:
            self._timer.cancel()
        return text
