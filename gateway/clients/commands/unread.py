"""Holds back the part of a reply that some programs leave unread on a network connection.

INDI's LX200 drivers read one byte of ``1Object Below Horizon.#``, and discard the rest in a way that has no effect on a
socket. They would take the text for the reply to their next command, and stay one reply behind from then on. So the
gateway holds the text back: it drops the text at the next command, and sends it after ``HOLD_TIME`` seconds without a
command. A program whose first byte is ``#`` is none of those drivers and gets its replies whole.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from gateway.core.wire_log import ClientLog

#: Seconds for which the text is held back: longer than the period at which those drivers poll (1 s), and shorter than
#: the time that any program waits for the rest of a reply (3 s).
HOLD_TIME = 1.2
#: Seconds added to ``HOLD_TIME``, so that a command that arrived while this computer was busy is read first.
SETTLE_TIME = 0.02
#: Bytes that programs send between commands and that are not part of a command.
_IGNORED_BYTES = b"#\r\n\0 "


class UnreadText:
    """Holds back the end of a reply for ``hold_time`` seconds. Infinity: it is never sent; 0: nothing is held back."""

    def __init__(
        self, send_bytes: Callable[[bytes], None], log: ClientLog, loop: asyncio.AbstractEventLoop, hold_time: float
    ) -> None:
        self._send_bytes, self._log, self._loop, self.hold_time = send_bytes, log, loop, hold_time
        self._held_text = b""
        self._timer: asyncio.TimerHandle | None = None

    def note_received(self, data: bytes) -> None:
        """Drop the held-back text at a command. If ``#`` precedes the command, send the text and hold back no more."""
        if data[:1] == b"#" and len(data) > 1:
            self.stop_holding_back()
        if data.strip(_IGNORED_BYTES):
            self.drop()

    def drop(self) -> None:
        """Drop the held-back text: the program has sent another command, or has disconnected."""
        if text := self._take_held_text():
            self._log.put("x", text, "not sent, because the program did not wait for it")

    def hold_back_rest(self, reply: bytes, byte_count: int, has_more_commands: bool) -> bytes:
        """Return the part of a reply to send now, the first ``byte_count`` bytes, and hold back the rest.

        ``has_more_commands``: the program has sent further commands without waiting for this reply. Then the reply is
        sent whole, or not at all if ``byte_count`` is 0.
        """
        if len(reply) <= byte_count or (has_more_commands and byte_count):
            return reply
        self._held_text = reply[byte_count:]
        if has_more_commands:
            self.drop()
        elif self.hold_time != float("inf"):
            self._timer = self._loop.call_later(self.hold_time, self._schedule_release)
        return reply[:byte_count]

    def _schedule_release(self) -> None:
        self._timer = self._loop.call_later(SETTLE_TIME, self._send_held_text)

    def _send_held_text(self) -> None:
        if text := self._take_held_text():
            self._send_bytes(text)

    def stop_holding_back(self) -> None:
        """Send the held-back text, and hold nothing back from now on."""
        self._send_held_text()
        self.hold_time = 0.0

    def _take_held_text(self) -> bytes:
        text, self._held_text = self._held_text, b""
        if self._timer is not None:
            self._timer.cancel()
        return text
