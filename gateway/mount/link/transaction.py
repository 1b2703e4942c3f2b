"""One exchange on an open line: a request, its reply, and whether that reply can be its own.

A reply counts only in its exact form and when nothing follows it: of two, one belongs to another request. A command
without a reply may still be objected to. After a disturbance the line is drained, and proofs are exchanged until it is
in step; otherwise every later reply would be taken for the answer to an earlier request.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from gateway.core.errors import Busy, Fault, Garbled, NoAnswer, Silence
from gateway.core.signals import Signal
from gateway.core.waiting import TimedEvent
from gateway.core.wire_log import WireLog
from gateway.mount.link.answers import LATEST, AnswerTimes, LateReplies
from gateway.mount.link.queue import RequestQueue
from gateway.protocols.base.driver import Send
from gateway.protocols.base.reply_rules import Expected, ReplyRules
from gateway.transport.wires import Transport

#: Seconds of quiet that end a disturbance.
QUIET = 0.15
#: No disturbance is waited out for longer than that at a time.
DRAIN = 5.0
#: A second copy of a reply follows the first within this; what might be mistaken for it is not asked before, where it
#: is an acknowledgement and no more, or where bytes that answer nothing have come within the last minutes.
GAP, UNRULY = 0.05, 300.0
#: Whoever talks on for so long after a question is not still answering it: quiet is waited for no longer.
BABBLE = 3.0
#: A reply that is an acknowledgement and no more counts when nothing has followed it for this long.
SETTLE = 0.02
#: A long piece of work of the mount may take that many seconds before what waits behind it is refused.
BUSY_AFTER = 1.0

#: What was answered, and that with how many bytes it takes.
Answer = dict[str, Any] | Fault
Taken = tuple[Answer, int]


class Transaction:
    """Exchanges over a wire, until it is ``lost``.

    Of what waits in the ``queue`` stops may go out while the mount is at a long piece of work, and one cuts the pause
    short that some mounts need after a command.
    """

    def __init__(self, wire: Transport, queue: RequestQueue, dialogue: ReplyRules, wire_log: WireLog) -> None:
        self.wire, self._queue = wire, queue
        self.dialogue, self.wire_log = dialogue, wire_log
        self.lost = False
        self.wire_lost: Signal[None] = Signal()
        #: The line was lost in the middle of an exchange: perhaps with half a command on the other side.
        self.half = False
        self.request = b""
        #: At a long piece of work, for so long that whatever else comes is refused, and when the last one was over.
        self.long, self.busy, self.long_until = False, False, -1e9
        #: When something was written last, seconds of the loop's clock; never yet is long ago.
        self.wrote = -1e9
        self.times = AnswerTimes()
        self.late = LateReplies(dialogue.alike)
        self._now = asyncio.get_running_loop().time
        #: Whether any byte has ever come; the last question that was not answered as it should, and what came instead.
        self.heard_ever = False
        self.trouble = b"", b""
        self._buffer, self._arrived = b"", TimedEvent()
        self._heard = self._stray = -1e9
        self._last: Send | None = None
        self._stops = 0
        #: When the last question was asked that has had no answer yet.
        self._unanswered_since: float | None = None
        self._settling = self._hurried = self._cut_short = False
        self._opened = 0

    def opening(self) -> tuple[Callable[[bytes], None], Callable[[str], None]]:
        """The wire is being opened -> what it calls; a reader that outlived its opening is not listened to."""
        self._opened += 1
        opening, self.lost = self._opened, False

        def on_data(data: bytes) -> None:
            if opening == self._opened:
                self._hear(data)

        def on_lost(reason: str) -> None:
            if opening == self._opened:
                self.lose(reason)

        return on_data, on_lost

    def _hear(self, data: bytes) -> None:
        self.wire_log.put("mount", "raw", data)
        self._buffer = (self._buffer + data)[-4096:]
        self.heard_ever = True
        self._heard = self._now()
        self._arrived.set()

    def lose(self, reason: str) -> None:
        """The wire is gone, whoever noticed it first."""
        if not self.lost:
            self.wire_log.put("mount", "v", note=reason)
            self.wire_lost.emit(None)
        self.lost = True
        self._arrived.set()
        self._queue.wake()

    def nudge(self, stop: bool) -> None:
        """A stop waits, or something else while the mount is at a long piece of work: it cannot wait for the reply."""
        self._hurried |= stop
        if self.long or (stop and self._settling):
            self._arrived.set()

    def send(self, request: bytes) -> bool:
        """Write to the wire -> whether it was there."""
        self.wire_log.put("mount", ">", request)
        self.request = request
        try:
            self.wire.write(request)
        except Exception as error:  # the port went away in the middle of it, whatever its driver calls that
            self.lose(str(error))
            return False
        return True

    # --- one exchange -----------------------------------------------------------------------------------------------

    def gap(self, ask: Send) -> float:
        """Seconds of quiet still wanted before a question, lest the rest of the last answer be taken for its own."""
        now = self._now()
        left = self._heard + GAP - now
        if left <= 1e-6 or now > self.wrote + BABBLE:
            return 0.0
        if not self._buffer:
            if self._last is None or not self.dialogue.alike(self._last, ask):
                return 0.0
            if now > self._stray + UNRULY and not self.dialogue.expected(ask).bare:
                return 0.0
        return left

    async def carry_out(self, ask: Send, stop: bool) -> Answer:
        """The exchange whose turn it is; a pause that was cut short for a stop is kept after it."""
        hurried, self._cut_short = self._cut_short, False
        try:
            outcome = await self.exchange(ask, firm=hurried, stop=stop)
            if hurried and stop and self.dialogue.expected(ask).pace:
                outcome = await self.exchange(ask, stop=True)  # a scope that needs its pause may have missed it
            return outcome
        finally:
            self.busy = False

    async def exchange(self, ask: Send, firm: bool = False, proof: bool = False, stop: bool = False) -> Answer:
        """One request and its reply, or the Fault that came instead. A ``firm`` pause after it is kept to its end; a
        ``proof`` is waited for as long as the protocol says. A ``stop`` waits for no quiet before it.
        """
        try:
            request = self.dialogue.encode(ask)
        except Fault as fault:
            return fault
        expected = self.dialogue.expected(ask)
        settle = GAP if stop and self.gap(ask) else SETTLE  # what did not wait before must look longer after
        self.drop("nobody asked")
        self._arrived.clear()
        self._last = ask
        began = self.wrote = self._now()
        self.long, self._stops, self._hurried = ask.long, 0, False
        taken = await self._reply(ask, expected, began, settle, proof) if self.send(request) else None
        self.long, self.long_until = False, self._now() if ask.long else self.long_until
        if taken is None:
            return self._unanswered(ask, expected, began)
        outcome, length = taken
        if len(self._buffer) > length + self._stops:  # a stop that was sent meanwhile may be refused by one byte
            outcome = Garbled()
        if isinstance(outcome, Garbled):
            self._distrust(ask, expected, began)
            self.drop("garbled")
            return outcome
        if ask.raw and isinstance(outcome, dict):
            outcome = {**outcome, "raw": self._buffer[:length]}
        self._cut(length)
        self.times.answered(self._heard - began, self._now() - began, counts=bool(length) and not ask.long)
        if expected.pace and await self._pause(expected.pace, firm):
            outcome = self._objection(ask) or outcome
        return outcome

    def _send_unanswered(self, ask: Send) -> bool | None:
        """Send a command that needs no answer -> whether the wire was there; None where it needs one."""
        return self.send(self.dialogue.encode(ask)) if self.dialogue.expected(ask).silent else None

    async def _pause(self, seconds: float, firm: bool) -> bool:
        """Give a scope time after a command without a reply. A stop cuts it short, unless ``firm``: then False."""
        until = self._now() + seconds
        while not self.lost and (left := until - self._now()) > 0:
            if not firm and self._queue.stop_waits:
                self._cut_short = True
                return False
            await self._queue.woken(left)
        return True

    async def _reply(self, ask: Send, expected: Expected, began: float, settle: float, proof: bool) -> Taken | None:
        """The reply and its length, once it is complete; None when it is not in time, or the wire was lost.

        A bare one is complete when nothing follows it for so many seconds (``settle``).
        """
        place = expected.kind == "position" and not proof
        deadline, busy_at = began + (ask.patience or self.times.patience(expected.timeout, place)), began + BUSY_AFTER
        while not self.lost:
            now = self._now()
            self._arrived.clear()
            if ask.long:
                self.busy = self.busy or now >= busy_at
                self._stops += self._queue.while_it_works(self.busy, self._send_unanswered)
            taken = self._take(ask) if self._buffer or expected.silent else None
            if taken is not None and self._stops and isinstance(taken[0], Busy):
                self._stops -= 1  # said to a stop, while nothing moves anyway
                self._cut(taken[1], "busy: the stop was not heard")
                self._arrived.set()
            elif taken is not None:
                if taken[1] and expected.bare and not self._hurried:
                    self._settling = True
                    if await self._arrived.within(settle):
                        taken = self._take(ask) or taken
                    self._settling = False
                return taken
            elif now >= deadline:
                return None
            await self._arrived.within((busy_at if ask.long and now < busy_at else deadline) - now)
        return None

    def _unanswered(self, ask: Send, expected: Expected, began: float) -> Fault:
        self.times.unanswered(self._now() - began)
        if self.lost:
            self.half = True
        elif ask.patience is not None and not ask.long and not self._buffer:
            return Silence()
        self._distrust(ask, expected, began)
        half = bool(self._buffer)
        self.drop("no complete answer")
        return Garbled() if half and ask.patience is not None else NoAnswer()

    def _distrust(self, ask: Send, expected: Expected, began: float) -> None:
        """The answer may still come."""
        self.late.add(ask, began + max(expected.timeout, ask.patience or 0.0) + LATEST)
        self._unanswered_since = began
        self.trouble = self.request, self._buffer

    def _objection(self, ask: Send) -> Fault | None:
        """What a command without a reply was answered with all the same: that the mount is busy."""
        taken = self._take(ask) if self._buffer else None
        if taken is None or not isinstance(taken[0], Fault):
            return None
        self._cut(taken[1])
        return taken[0]

    def _take(self, ask: Send) -> Taken | None:
        """The reply, when it is complete; one that cannot be read at all is garbled, never the end of the line."""
        try:
            return self.dialogue.take(ask, self._buffer)
        except Exception:  # whatever it is, the line goes on
            return Garbled(), len(self._buffer)

    def _cut(self, length: int, note: str = "") -> None:
        self.wire_log.put("mount", "<", self._buffer[:length], note)
        self._buffer = self._buffer[length:]

    def drop(self, why: str) -> None:
        if self._buffer:
            self._stray = self._now()
            self._cut(len(self._buffer), f"dropped: {why}")

    async def drain(self, quiet: float) -> bool:
        """Wait until the wire has been quiet for so long, and forget what came -> whether anything did."""
        give_up = self._now() + DRAIN
        while not self.lost and self._now() < give_up:
            left = max(self._heard, self.wrote) + quiet - self._now()
            self._arrived.clear()
            if left <= 1e-6 or not await self._arrived.within(left):
                break
        anything = bool(self._buffer)
        if anything and self._unanswered_since is not None:
            self.times.came_late(self._heard - self._unanswered_since)
        self._unanswered_since = None
        self.drop("drained")
        return anything
