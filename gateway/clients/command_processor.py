"""A client: bytes in, replies out, in order, at its own pace.

One ``Client`` belongs to one connection. What the snapshot can answer is answered within the call that delivered the
bytes; the rest waits in a task of this client's own, so nobody waits for anybody else. A reply that was made of
snapshot answers alone is good again for as long as they are.

A reply stands in the place of its command, or is absent: what is not answered in time is never answered, and those
behind it are. What it asked for is done all the same, unless it would set something moving that late.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

from gateway.clients.access import Rights
from gateway.clients.equinox import Equinox
from gateway.clients.outstanding import Begun
from gateway.clients.pushes import Pushes
from gateway.core.errors import Busy, Fault, NoAnswer
from gateway.core.motion_kinds import BY_HAND, begins_motion
from gateway.core.operations import CancelGoto, ClockFromGps, Halt, Operation, Own, Read, Stop, Sync
from gateway.core.wire_log import Transcript
from gateway.mount.controller import MountController
from gateway.mount.link.queue import AT_ONCE, LATE
from gateway.mount.readings.cache import FRESH, MISSING
from gateway.mount.safety.rules.dead_man import HostActivity
from gateway.protocols.base.ends import Ending
from gateway.protocols.base.frames import Framing, Unterminated
from gateway.protocols.base.surface import (
    Defer,
    FireAndForget,
    Handling,
    Possible,
    ReuseLastReading,
    Session,
    Speed,
    Surface,
)
from gateway.transport.baud_trial import BaudTrial

#: Commands that may wait for their turn in one connection; more than that and the oldest are dropped.
INBOX = 256
MEMO = 32
#: In the place of the count of stops: it was sent before all of them, and nobody may be there any more who sent it. It
#: begins no motion and holds none.
LONG_AGO = -1
#: Seconds after which a reply is not given any more: programs have gone on by then, and would take it for that of the
#: next (NexStar protocol: the hand control answers within 3.5 s). The mount is waited for a little less long, so that
#: what came together with a command which it does not answer is answered itself.
ANSWER_WITHIN, WAIT_FOR_MOUNT = 3.5, 3.4
#: A motion that is not begun so many seconds after it was asked for is refused, while that can still be said.
NO_IN_TIME = 3.0
#: What takes minutes by its manual, and ends with the next command: its answer is waited for until that comes.
LASTING = ClockFromGps
#: A half that is asked for within this many seconds of the other one belongs to the same instant.
PAIR = 1.0


class Told(NamedTuple):
    """What this client was last told by a read, when, and the hub's version then."""

    value: Any
    at: float
    version: int


class Turn:
    """A command on its way to its reply, which came at this loop time, after so many stops.

    ``ending`` is what it has ended already, when it came. ``plain`` and ``spent`` say whether it may be repeated,
    ``halting`` that it has ended a motion last, ``baud`` the rate to go on with after its answer. It is ``late`` once
    nobody waits for its reply any more.
    """

    __slots__ = (
        "baud",
        "came",
        "ending",
        "frame",
        "halting",
        "lasting",
        "late",
        "plain",
        "spent",
        "steps",
        "stops",
        "timer",
    )

    def __init__(self, frame: bytes, stops: int, ending: Ending | None, came: float) -> None:
        self.frame, self.stops, self.ending, self.came = frame, stops, ending, came
        self.steps: Handling
        self.spent: list[type[Operation]] = []
        self.plain, self.halting, self.lasting, self.late = True, False, False, False
        self.baud: int | None = None
        self.timer: asyncio.TimerHandle | None = None


class CommandProcessor:
    """Answers one connection. ``write`` takes reply bytes."""

    def __init__(
        self,
        name: str,
        controller: MountController,
        surface: Surface,
        session: Session,
        framing: Framing,
        write: Callable[[bytes], Any],
        equinox: Equinox | None,
        transcript: Transcript,
        life: HostActivity,
    ) -> None:
        self.life = life
        self.name, self.controller, self.surface, self.session = name, controller, surface, session
        self.framing, self.write, self.equinox = framing, write, equinox
        self.transcript = transcript
        self._inbox: deque[Turn] = deque(maxlen=INBOX)
        #: The command that waits for the mount; those that nobody waits for any more.
        self._task: asyncio.Task[None] | None = None
        self._late: set[asyncio.Task[None]] = set()
        #: What that is; and whether it is waited for until the next command comes.
        self._turn: Turn | None = None
        self._lasting = False
        #: When the bytes came that are being fed, loop time.
        self.came: Callable[[], float] = controller.now
        self.rights = Rights()
        #: The program that this was recognised as.
        self.profile = ""
        self.open = True
        #: Whether the last bytes did nothing but end motions without a reply.
        self.ended = False
        self._begun = Begun(self)
        self._deferred: dict[str, asyncio.TimerHandle] = {}
        self._told: dict[type[Operation], Told] = {}
        self._memo: dict[bytes, tuple[bytes, list[type[Operation]]]] = {}
        self._idle = True
        self._memo_version, self._memo_until = -1, 0.0
        self._pushes: Pushes | None = None
        #: Where the connection is a serial port: its baud rate.
        self.rate: BaudTrial | None = None

    @property
    def busy(self) -> bool:
        """Whether anything it has asked for is still under way."""
        return self._task is not None or bool(self._late) or bool(self._begun)

    @property
    def answered(self) -> bool:
        """Whether nothing waits here for its turn or for the mount's answer."""
        return self._task is None and not self._inbox

    def feed(self, data: bytes, stops: int | None = None) -> None:
        """Take bytes as they arrived; ``stops`` is the hub's count of stops then, where that was some time ago."""
        self.life.heard |= stops != LONG_AGO
        controller = self.controller
        if self.transcript.sinks:
            self.transcript.put(self.name, "raw", data)
        if self._idle and self._task is None and data in self._memo and self._memo_version == controller.version:
            now = controller.now()
            if now < self._memo_until:
                reply, kinds = self._memo[data]
                controller.touch(kinds, now)
                self.session.last = data
                if self.transcript.sinks:
                    self.transcript.put(self.name, ">", data)
                    self.transcript.put(self.name, "<", reply)
                self.write(reply)
                return
        frames = self.framing(data)
        if self.transcript.sinks:
            self._tell_dropped()
        self._idle = self.framing.idle  # else what comes next may belong to what came before
        ended: set[bytes] = set()  # by what stands here since anything else was asked for: the same again is no news
        self.ended = bool(frames)
        for frame in frames:
            if isinstance(frame, Unterminated):
                self.transcript.note(self.name, frame.words)
            if self.rate is not None and self.surface.protocol.find(frame) is not None:
                self.rate.understood()
            if frame in ended:
                self.transcript.put(self.name, "x", frame, "the same again, with nothing between: done once for both")
                continue
            ending = self.surface.ending(self.session, frame)
            if ending is None:
                ended.clear()
                self.ended = False
            else:
                ended.add(frame)
                self._end(frame, ending)
            if len(self._inbox) == INBOX:
                self.transcript.put(self.name, "x", self._inbox[0].frame, f"more than {INBOX} commands wait")
            self._inbox.append(Turn(frame, controller.stops if stops is None else stops, ending, self.came()))
        if self._lasting and self._inbox and self._turn is not None:
            self._give_up(self._turn)
        if self._task is None:
            self._pump()

    def _tell_dropped(self) -> None:
        """For the log: bytes that are of no use, and why."""
        for why, data in self.framing.dropped.items():
            self.transcript.put(self.name, "x", bytes(data), why)

    def _pump(self) -> None:
        """Answer what waits, until something must be waited for, or the gateway ends."""
        while self._inbox and not self.controller.closed:
            turn = self._inbox.popleft()
            self.transcript.put(self.name, ">", turn.frame)
            turn.steps = self.surface.handle(self.session, turn.frame)
            try:
                wanted = self._through(turn, None)
            except StopIteration as end:
                again = self._again_in_a_row(turn.frame) if turn.halting else 0
                self._answer(turn, end.value * (1 + again) if end.value else None)
                continue
            except Exception as error:  # a defect must cost one command, never the client's connection
                self._defect(turn.frame, error)
                continue
            self._task, self._turn = self.controller.loop.create_task(self._wait(turn, wanted)), turn
            until = turn.came + WAIT_FOR_MOUNT
            if self.controller.now() < until:
                turn.timer = self.controller.loop.call_at(until, self._give_up, turn)
                return
            self._forget(turn)

    def _give_up(self, turn: Turn) -> None:
        """The mount has not answered in time: those behind it have their turn, and this one has no reply any more."""
        self._lasting = turn.lasting and not self._inbox
        if turn is self._turn and not self._lasting:
            self._forget(turn)
            self._pump()

    def _forget(self, turn: Turn) -> None:
        """Nobody waits for the outcome of what is under way: it is answered as where the mount does not answer."""
        assert self._task is not None
        self._late.add(self._task)
        self._task.add_done_callback(self._late.discard)
        self._task, self._turn, turn.late = None, None, True
        reply = self.surface.unanswered(turn.frame, NoAnswer())
        if not reply:
            self._too_late(turn.frame)
        self._answer(turn, reply)

    def _too_late(self, frame: bytes) -> None:
        found = self.surface.protocol.find(frame)
        if found is not None and not found[0].replies:
            return
        self.transcript.note_once(
            self.name,
            f"no reply to {frame!r}: the mount has not answered within "
            f"{ANSWER_WITHIN} s, and later its answer would be taken for another's",
            self.name.rpartition(":")[0],
        )

    def _again_in_a_row(self, frame: bytes) -> int:
        """How often a halt that has just been asked for follows once more; what was done for it does for all."""
        count = 0
        while self._inbox and self._inbox[0].frame == frame:
            self.transcript.put(self.name, ">", self._inbox.popleft().frame)
            count += 1
        return count

    def _through(self, turn: Turn, answer: Any, fault: Fault | None = None) -> Operation:
        """Go on with a command as far as it goes without waiting -> the operation that must be waited for."""
        while True:
            wanted = turn.steps.send(answer) if fault is None else turn.steps.throw(fault)
            answer, fault, turn.lasting = None, None, isinstance(wanted, LASTING)
            if isinstance(wanted, FireAndForget):
                turn.plain = False
                if self._refused(wanted.operation, turn.came):
                    continue
                turn.halting = isinstance(wanted.operation, Halt | CancelGoto)
                if turn.ending is None or wanted.operation != turn.ending.operation:
                    self._begun.begin(wanted.operation, turn.stops)
            elif isinstance(wanted, Possible):
                turn.plain = False
                fault = self._refused(wanted.operation, turn.came) or self._impossible(wanted.operation)
            elif isinstance(wanted, Defer):
                turn.plain = False
                self._defer(wanted)
            elif isinstance(wanted, Speed):
                turn.plain, turn.baud = False, wanted.baud
            else:
                if isinstance(wanted, ReuseLastReading):
                    wanted = wanted.operation
                    answer = self._again(wanted, turn)
                    if answer is not None:
                        continue
                fault = self._refused(wanted, turn.came)
                if fault is not None:
                    turn.plain = False
                    continue
                value = self.controller.peek(wanted)
                if value is MISSING:
                    return wanted
                if type(wanted) in FRESH:
                    turn.spent.append(type(wanted))
                elif not (isinstance(wanted, Own) and wanted.keep == "fixed"):
                    turn.plain = False
                answer = self._tell(wanted, value)

    def _refused(self, operation: Operation, came: float) -> Fault | None:
        """What this client is told no with, where it may not ask for this or it is too late; the transcript knows."""
        late = self.controller.now() - came
        if late > AT_ONCE and (isinstance(operation, BY_HAND) or (late > WAIT_FOR_MOUNT and _never_late(operation))):
            self.transcript.refused(self.name, f"{type(operation).__name__}: {LATE}")
            return Busy(LATE)
        refusal = self.rights.refusal(operation)
        if refusal is not None:
            self.refuse(type(operation).__name__, refusal.why)
        return None if refusal is None else refusal.fault

    def _impossible(self, operation: Operation) -> Fault | None:
        """What this client is told no with where nothing can come of it; the transcript knows."""
        fault = self.controller.impossible(operation)
        if fault is not None:
            self.transcript.refused(self.name, f"{type(operation).__name__}: {fault}")
        return fault

    def refuse(self, what: str, why: str) -> None:
        """Leave a note of what a client was refused, once for every host."""
        self.transcript.refused(self.name, f"{what} refused: {why}", self.name.rpartition(":")[0])

    def _again(self, operation: Operation, turn: Turn) -> Any:
        """What this client was told a moment ago; None when that is too long ago."""
        told = self._told.get(type(operation))
        if told is None or self.controller.now() - told.at >= PAIR:
            return None
        if told.version == self.controller.version:
            turn.spent.append(type(operation))
        else:
            turn.plain = False
        return told.value

    def _tell(self, operation: Operation, value: Any) -> Any:
        """An answer as the client is told it."""
        value = self._outward(operation, value)
        if type(operation) in FRESH:
            self._told[type(operation)] = Told(value, self.controller.now(), self.controller.version)
        return value

    async def _finish(self, turn: Turn, wanted: Operation) -> Any:
        """Wait for one operation after the other until the command is done -> its reply."""
        while True:
            answer, fault = None, None
            try:
                patience = turn.came + NO_IN_TIME - self.controller.now()
                told = await self.controller.perform(self.inward(wanted), turn.stops, self.life, patience)
                answer = self._tell(wanted, told)
            except Fault as error:
                words = f"{type(wanted).__name__}: {error}"
                (self.transcript.note if isinstance(wanted, Read) else self.transcript.refused)(self.name, words)
                fault = error
            try:
                wanted = self._through(turn, answer, fault)
            except StopIteration as end:
                return end.value

    async def _wait(self, turn: Turn, wanted: Operation) -> None:
        """Finish a command that needs the mount, then the ones that came meanwhile."""
        turn.plain = False
        reply = None
        try:
            reply = await self._finish(turn, wanted)
        except Exception as error:
            self._defect(turn.frame, error)
        finally:
            if not turn.late:
                self._task = self._turn = None
                self._lasting = False
                if turn.timer is not None:
                    turn.timer.cancel()
        if turn.late:
            self._say_refused(turn.frame)
            return
        self._answer(turn, reply)
        self._pump()

    def _defect(self, frame: bytes, error: Exception) -> None:
        self.transcript.note(self.name, f"internal error at {frame!r}, please report it: {error!r}")
        if self.controller.motions.busy:
            self.controller.begin_stop()  # what failed may have been what should have ended a motion

    def _answer(self, turn: Turn, reply: bytes | None) -> None:
        frame = self.session.last = turn.frame
        self._say_refused(frame)
        if turn.plain and turn.spent and reply:
            self._remember(turn, reply)
        elif not (turn.plain and turn.spent):
            self._memo.clear()
        if reply and self.controller.now() - turn.came > ANSWER_WITHIN and not turn.lasting:
            reply = None
            self._too_late(frame)
        if reply:
            self.transcript.put(self.name, "<", reply)
            self.write(reply)
        elif self.transcript.sinks:
            self._explain(frame)
        if turn.baud is not None and self.rate is not None:
            self.rate.begin(turn.baud)

    def _say_refused(self, frame: bytes) -> None:
        if self.session.refused:
            why, self.session.refused = self.session.refused, ""
            self.transcript.refused(self.name, f"{frame!r} refused: {why}", self.name.rpartition(":")[0])

    def _explain(self, frame: bytes) -> None:
        """Leave a reason for a silence, once for every command of every host."""
        if why := self.surface.silence(self.session, frame):
            self.transcript.note_once(self.name, f"no reply to {frame!r}: {why}", self.name.rpartition(":")[0])

    def _remember(self, turn: Turn, reply: bytes) -> None:
        """The same question gets the same reply until an answer it was made of is renewed or grows old."""
        outdated = self._memo_version != self.controller.version or self.controller.now() >= self._memo_until
        if outdated or len(self._memo) >= MEMO:
            self._memo.clear()
            self._memo_version, self._memo_until = self.controller.version, float("inf")
        self._memo[turn.frame] = reply, turn.spent
        self._memo_until = min(self._memo_until, self.controller.fresh_until(turn.spent))

    def _end(self, frame: bytes, ending: Ending) -> None:
        """End a motion before everything that waits here, and take back what would begin it."""
        for waiting in [turn for turn in self._inbox if turn.frame in ending.takes_back]:
            self._inbox.remove(waiting)
            self.transcript.put(self.name, "x", waiting.frame, f"taken back by {frame!r}, which came before its turn")
        if isinstance(ending.operation, Stop):
            self.controller.begin_stop()
        else:
            self._begun.begin(ending.operation, self.controller.stops)

    def _defer(self, wanted: Defer) -> None:
        old = self._deferred.pop(wanted.special, None)
        if old is not None:
            old.cancel()
        self._deferred[wanted.special] = self.controller.loop.call_later(
            wanted.seconds, lambda: self.controller.spawn(self._deferred_special(wanted.special))
        )

    async def _deferred_special(self, special: str) -> None:
        """Run a special later; it has no reply, so it may also outlive its connection."""
        turn = Turn(special.encode(), self.controller.stops, None, self.controller.now())
        turn.steps = self.surface.handlers[special](self.session, None, {})  # type: ignore[arg-type]
        try:
            await self._finish(turn, self._through(turn, None))
        except StopIteration:
            return
        except Fault as fault:
            self.transcript.note(self.name, f"{special}: {fault}")
        except Exception as error:
            self._defect(special.encode(), error)

    def push(self) -> None:
        """Begin to tell the client what its surface tells without being asked."""
        if subscriptions := self.surface.subscriptions(self.session):
            controller = self.controller
            self._pushes = Pushes(
                subscriptions, self._reading, self._send, lambda: self.write(b"") or 0, controller.spawn
            )

    async def _reading(self, operation: Operation) -> Any:
        """A reading as this client is told it. Raises Fault."""
        value = self.controller.peek(operation)
        if value is MISSING:
            value = await self.controller.perform(self.inward(operation), self.controller.stops, self.life)
        return self._outward(operation, value)

    def _send(self, data: bytes) -> None:
        """Bytes that nobody has asked for."""
        self.transcript.put(self.name, "<", data)
        self.write(data)

    def inward(self, operation: Operation) -> Operation:
        return operation if self.equinox is None else self.equinox.inward(operation)

    def _outward(self, operation: Operation, value: Any) -> Any:
        return value if self.equinox is None else self.equinox.outward(operation, value)

    def close(self) -> None:
        """The connection is gone: what it asked for is still done, the replies go nowhere."""
        self.open = False
        self.write = lambda data: None
        if self._pushes is not None:
            self._pushes.close()
        for frame in self.framing.end():  # the next connection must not build on what was before half a command
            self.transcript.note(self.name, frame.words)
            deque(self.surface.handle(self.session, frame), 0)
        self._tell_dropped()
        if self.rate is not None:
            self.rate.end()


def _never_late(operation: Operation) -> bool:
    """Whether it is not to be done when whoever asked for it is not told any more: a motion, or a sync."""
    return begins_motion(operation) or isinstance(operation, Sync)
