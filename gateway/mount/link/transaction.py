"""Talk on an open wire: a request, its reply, and whether that reply can be its own.

A reply counts in its exact form, and only when nothing follows it: of two, one belongs to somebody else. A command that
has no reply may be objected to all the same. After a disturbance the wire is drained, and proofs are exchanged until
the line is in step again, or every later answer would belong to an earlier question.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from gateway.core.errors import Busy, Fault, Garbled, NoAnswer, Silence
from gateway.core.wire_log import Transcript
from gateway.mount.link.late_replies import LATEST, LateReplies
from gateway.protocols.base.driver import Send
from gateway.protocols.base.reply_rules import ReplyRules

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
#: A place is missed after so many times what answers take, and no sooner than these seconds, once so many have come.
QUICK, SOON, KNOWN = 8.0, 1.2, 20
#: Where an answer has come too late, and no later than these seconds, the next are waited for so much longer.
LATER, LATEST_ANSWER = 1.5, 6.0
#: The first answer tells how long answers take, up to so many seconds.
FIRST_ANSWER = 1.0
#: A long piece of work of the mount may take that many seconds before what waits behind it is refused.
BUSY_AFTER = 1.0


class Transaction:
    """Exchanges over ``write``, until the wire is ``lost``.

    ``meanwhile`` is called while the mount is at a long piece of work, with whether it counts as busy by now; it sends
    what may be sent all the same and returns how many requests that were. ``pause`` waits after a command without a
    reply; it returns False when a stop has cut that short.
    """

    def __init__(
        self,
        write: Callable[[bytes], None],
        meanwhile: Callable[[bool], int],
        pause: Callable[[float, bool], Awaitable[bool]],
        dialogue: ReplyRules,
        transcript: Transcript,
    ) -> None:
        self._write, self._meanwhile, self._pause = write, meanwhile, pause
        self.dialogue, self.transcript = dialogue, transcript
        self.lost = False
        #: The line was lost in the middle of an exchange: perhaps with half a command on the other side.
        self.half = False
        #: The last request; and what is to be done in the moment in which the wire is noticed to be lost.
        self.request = b""
        self.on_lost: Callable[[], None] = lambda: None
        #: At a long piece of work, and when the last one was over.
        self.long, self.long_until = False, -1e9
        #: When something was written last, seconds of the loop's clock; never yet is long ago.
        self.wrote = -1e9
        #: How long an answer takes, and the last one took on the wire, in seconds; how many there were.
        self.typical, self.took, self.answers = 0.02, 0.0, 0
        self.doubt = LateReplies(dialogue.alike)
        self._now = asyncio.get_running_loop().time
        #: Whether any byte has ever come; the last question that was not answered as it should, and what came instead.
        self.heard_ever = False
        self.trouble = b"", b""
        self._buffer = b""
        self._arrived = asyncio.Event()
        self._heard = self._stray = -1e9
        self._last: Send | None = None
        self._proofs = 0
        self._stops = 0
        #: When the last question was asked that has had no answer yet; how late one came, seconds, 0 where none has.
        self._unanswered_since: float | None = None
        self._late = 0.0
        self._proving = False
        self._settling = self._hurried = False

    def hear(self, data: bytes) -> None:
        """Bytes have come."""
        self.transcript.put("mount", "raw", data)
        self._buffer = (self._buffer + data)[-4096:]
        self.heard_ever = True
        self._heard = self._now()
        self._arrived.set()

    def lose(self, reason: str) -> None:
        """The wire is gone, whoever noticed it first."""
        if not self.lost:
            self.transcript.put("mount", "v", note=reason)
            self.on_lost()
        self.lost = True
        self._arrived.set()

    def nudge(self, stop: bool) -> None:
        """Something waits that may have to be sent before the reply comes, or as soon as it has come."""
        self._hurried |= stop
        if self.long or (stop and self._settling):
            self._arrived.set()

    def send(self, request: bytes) -> bool:
        """Write to the wire -> whether it was there."""
        self.transcript.put("mount", ">", request)
        self.request = request
        try:
            self._write(request)
        except Exception as error:  # the port went away in the middle of it, whatever its driver calls that
            self.lose(str(error))
            return False
        return True

    # --- one exchange -----------------------------------------------------------------------------------------------

    def gap(self, ask: Send) -> float:
        """Seconds of quiet still wanted before a question, lest the rest of the last answer be taken for its own."""
        if self._now() > self.wrote + BABBLE:
            return 0.0
        if not self._buffer:
            if self._last is None or not self.dialogue.alike(self._last, ask):
                return 0.0
            if self._now() > self._stray + UNRULY and not self.dialogue.bare(ask):
                return 0.0
        left = self._heard + GAP - self._now()
        return left if left > 1e-6 else 0.0

    def timeout(self, ask: Send) -> float:
        """Seconds that the answer to a question may take on this line."""
        longest = max(self.dialogue.timeout(ask), self._late and LATER * self._late)
        if self.dialogue.kind(ask) != "position" or self.answers < KNOWN or self._proving:
            return longest
        return min(longest, max(SOON, QUICK * self.typical))  # it is asked again and again: a lost one is soon missed

    async def exchange(self, ask: Send, firm: bool = False) -> dict[str, Any] | Fault:
        """One request and its reply, or the Fault that came instead. A ``firm`` pause after it is kept to its end."""
        try:
            request = self.dialogue.encode(ask)
        except Fault as fault:
            return fault
        settle = GAP if self.gap(ask) else SETTLE  # a stop does not wait before, so it must look longer after
        self.drop("nobody asked")
        self._arrived.clear()
        self._last = ask
        began = self.wrote = self._now()
        self.long, self._stops, self._hurried = ask.long, 0, False
        taken = await self._reply(ask, began, settle) if self.send(request) else None
        self.long, self.long_until = False, self._now() if ask.long else self.long_until
        if taken is None:
            return self._unanswered(ask, began)
        outcome, length = taken
        if len(self._buffer) > length + self._stops:  # a stop that was sent meanwhile may be refused by one byte
            outcome = Garbled()
        if isinstance(outcome, Garbled):
            self._distrust(ask, began)
            self.drop("garbled")
            return outcome
        if ask.raw and isinstance(outcome, dict):
            outcome = {**outcome, "raw": self._buffer[:length]}
        self._cut(length)
        self.took = self._heard - began
        self.answers += 1
        if length and not ask.long:  # what is not answered takes no time
            self.typical += 0.2 * (min(self._now() - began, 3.0 * self.typical + 0.01) - self.typical)
            if self.answers == 1:
                self.typical = max(self.typical, min(self._now() - began, FIRST_ANSWER))
        pace = self.dialogue.pace(ask)
        if pace and await self._pause(pace, firm):
            outcome = self._objection(ask) or outcome
        return outcome

    async def _reply(self, ask: Send, began: float, settle: float) -> tuple[dict[str, Any] | Fault, int] | None:
        """The reply and its length, once it is complete; None when it is not in time, or the wire was lost."""
        deadline, busy_at = began + (ask.patience or self.timeout(ask)), began + BUSY_AFTER
        while not self.lost:
            now = self._now()
            self._arrived.clear()
            if ask.long:
                self._stops += self._meanwhile(now >= busy_at)
            taken = self._take(ask)
            if taken is not None and self._stops and isinstance(taken[0], Busy):
                self._stops -= 1  # said to a stop, while nothing moves anyway
                self._cut(taken[1], "busy: the stop was not heard")
                self._arrived.set()
            elif taken is not None:
                if taken[1] and self.dialogue.bare(ask) and not self._hurried:
                    self._settling = True
                    if await self._something_within(settle):
                        taken = self._take(ask) or taken
                    self._settling = False
                return taken
            elif now >= deadline:
                return None
            await self._something_within((busy_at if ask.long and now < busy_at else deadline) - now)
        return None

    def _unanswered(self, ask: Send, began: float) -> Fault:
        """What it means that no reply came."""
        self.took = self._now() - began
        if self.lost:
            self.half = True
        elif ask.patience is not None and not ask.long and not self._buffer:
            return Silence()
        self._distrust(ask, began)
        half = bool(self._buffer)
        self.drop("no complete answer")
        return Garbled() if half and ask.patience is not None else NoAnswer()

    def _distrust(self, ask: Send, began: float) -> None:
        """The answer may still come."""
        self.doubt.add(ask, began + max(self.dialogue.timeout(ask), ask.patience or 0.0) + LATEST)
        self._unanswered_since = began
        self.trouble = self.request, self._buffer

    def _objection(self, ask: Send) -> Fault | None:
        """What a command without a reply was answered with all the same: that the mount is busy."""
        taken = self._take(ask) if self._buffer else None
        if taken is None or not isinstance(taken[0], Fault):
            return None
        self._cut(taken[1])
        return taken[0]

    def _take(self, ask: Send) -> tuple[dict[str, Any] | Fault, int] | None:
        """The reply, when it is complete; one that cannot be read at all is garbled, never the end of the line."""
        try:
            return self.dialogue.take(ask, self._buffer)
        except Exception:  # whatever it is, the line goes on
            return Garbled(), len(self._buffer)

    def _cut(self, length: int, note: str = "") -> None:
        """The bytes of an answer leave the buffer."""
        self.transcript.put("mount", "<", self._buffer[:length], note)
        self._buffer = self._buffer[length:]

    def drop(self, why: str) -> None:
        """Forget bytes that answer nothing."""
        if self._buffer:
            self._stray = self._now()
            self._cut(len(self._buffer), f"dropped: {why}")

    # --- in step again ----------------------------------------------------------------------------------------------

    async def in_step(self) -> bool:
        """Whether every proof is answered as it should be, and nothing follows."""
        self._proofs += 1
        for ask in self.dialogue.proof(self._proofs):
            await asyncio.sleep(self.gap(ask))
            self._proving = True
            try:
                outcome = await self.exchange(ask)
            finally:
                self._proving = False
            if isinstance(outcome, Busy):
                continue  # that is an answer, too
            if isinstance(outcome, Fault) or not self.dialogue.proven(ask, outcome):
                return False
        return not await self.drain(QUIET)

    async def drain(self, quiet: float) -> bool:
        """Wait until the wire has been quiet for so long, and forget what came -> whether anything did."""
        give_up = self._now() + DRAIN
        while not self.lost and self._now() < give_up:
            left = max(self._heard, self.wrote) + quiet - self._now()
            self._arrived.clear()
            if left <= 1e-6 or not await self._something_within(left):
                break
        anything = bool(self._buffer)
        if anything and self._unanswered_since is not None:
            took = self._heard - self._unanswered_since
            self._late = took if took <= LATEST_ANSWER else self._late
        self._unanswered_since = None
        self.drop("drained")
        return anything

    async def _something_within(self, seconds: float) -> bool:
        """Wait for bytes -> whether any came in time (or the wire was lost)."""
        try:
            async with asyncio.timeout(seconds):
                await self._arrived.wait()
        except TimeoutError:
            return False
        return True
