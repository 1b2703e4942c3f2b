"""Answers one connection: bytes in, replies out, in the order of the commands.

Commands that can be answered from the readings cache are answered within the call that delivered the bytes. The others
wait in a task of this connection, so that no client waits for another. A reply made only of cached readings is reused
while they are valid. Replies keep the order of the commands. A reply that comes too late is dropped, and the next
commands are answered; the operation of the late command is still carried out, unless it would begin a motion.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Coroutine, Sequence

from gateway.clients.access import Rights
from gateway.clients.commands.turn import (
    MOUNT_TIMEOUT,
    REPLY_TIMEOUT,
    STALE_STOP_COUNT,
    CommandRunner,
    Inbox,
    PendingCommand,
)
from gateway.clients.commands.unread import UnreadText
from gateway.clients.profiles import ClientProfile, SurfaceBinding
from gateway.core.errors import Fault, NoAnswer
from gateway.core.operations import AbortMotion, Direction, Operation, StopAxis
from gateway.core.wire_log import ClientLog, printable
from gateway.mount.controller import MountController
from gateway.mount.motion.taps import is_free_or_ending
from gateway.mount.presence import HostActivity
from gateway.protocols.base.frames import RESYNC_GAP, Unterminated
from gateway.protocols.base.session import Session
from gateway.protocols.base.surface import Surface, UrgentEnd
from gateway.protocols.base.wants import Subscription
from gateway.transport.baud import BaudTrial
from gateway.transport.handler import NewConnection

#: If all four arrows are released within this many seconds, the mount is stopped.
RELEASE_WINDOW = 0.3


class ArrowReleases:
    """Decides what the release of an arrow stops: the motion of an axis, all motion, or nothing yet.

    If the press of the arrow still waits in ``inbox``, press and release become a tap, which is carried out later.
    ``sends_stop_all``: the program sends a command that stops all motion when an arrow is released.
    """

    def __init__(self, controller: MountController, surface: Surface, inbox: Inbox, sends_stop_all: bool) -> None:
        self._controller, self._surface, self._inbox, self.sends_stop_all = controller, surface, inbox, sends_stop_all
        #: The commands of the releases in the last ``RELEASE_WINDOW`` seconds, with the loop times of their arrival.
        self._released_at: dict[bytes, float] = {}

    def find_end(self, frame: bytes, ending: UrgentEnd, now: float, running: PendingCommand | None) -> UrgentEnd | None:
        """Return what the command ``frame`` must end now; None if nothing moves and its arrow's press still waits."""
        release = ending.operation
        if not isinstance(release, StopAxis):
            return ending
        self._released_at = {earlier: at for earlier, at in self._released_at.items() if now - at <= RELEASE_WINDOW} | {
            frame: now
        }
        if len(self._released_at) == len(Direction):
            self._released_at.clear()
            return UrgentEnd(AbortMotion(), ending.discarded)
        tapped = (
            self._inbox and self._is_at_rest(release.axis, running) and self._inbox.note_release(ending.discarded, now)
        )
        return None if tapped else ending

    def _is_at_rest(self, axis: int, running_command: PendingCommand | None) -> bool:
        """Whether the release of an arrow has nothing to end: no arrow moves this axis, and no goto runs or waits."""
        wanted = self._controller.wanted.value
        if not is_free_or_ending(wanted, axis) or wanted.waiting_gotos or self._controller.slewing:
            return False
        waiting = [*self._inbox, running_command] if running_command is not None else self._inbox
        return not any(self._surface.begins_goto(pending.frame) for pending in waiting)


class ReadingPusher:
    """Sends the readings that a client has subscribed to, at their periods, without a request for each.

    Each subscription has a task of its own, so that a slow reading does not delay the others. A reading is skipped if
    the mount cannot give it, or if the client has not read the earlier bytes. ``read_operation`` returns a reading in
    the client's equinox, ``send_bytes`` writes bytes, ``count_unsent`` returns how many bytes are still unsent.
    """

    def __init__(
        self,
        subscriptions: Sequence[Subscription],
        read_operation: Callable[[Operation], Awaitable[object]],
        send_bytes: Callable[[bytes], None],
        count_unsent: Callable[[], int],
        spawn: Callable[[Coroutine[object, object, None]], asyncio.Task[None]],
    ) -> None:
        self._read_operation, self._send_bytes, self._count_unsent = read_operation, send_bytes, count_unsent
        self._tasks = [spawn(self._serve(subscription)) for subscription in subscriptions]

    async def _serve(self, subscription: Subscription) -> None:
        """Send the readings of a subscription until cancelled. Readings whose time has passed are skipped."""
        now = asyncio.get_running_loop().time
        last, due = b"", now() + subscription.first_delay
        if subscription.first_delay:
            await asyncio.sleep(subscription.first_delay)
        while True:
            if not self._count_unsent():
                last = await self._push(subscription, last)
            due = max(due + subscription.period, now())
            await asyncio.sleep(due - now())

    async def _push(self, subscription: Subscription, last_bytes: bytes) -> bytes:
        """Send a reading, unless the client wants only changes and there is none. Return the bytes sent last."""
        try:
            data = subscription.encode(await self._read_operation(subscription.operation))
        except Fault:
            return last_bytes
        if not data or (subscription.only_changes and data == last_bytes):
            return last_bytes
        self._send_bytes(data)
        return data

    def close(self) -> None:
        for task in self._tasks:
            task.cancel()


class CommandProcessor:
    """Answers the commands of one connection; ``rights`` limits what its client may do."""

    def __init__(
        self,
        peer: NewConnection,
        controller: MountController,
        binding: SurfaceBinding,
        session: Session,
        activity: HostActivity,
        rights: Rights,
    ) -> None:
        self.activity = activity
        self.controller, self.surface, self.session = controller, binding.surface, session
        self._wanted_state = controller.wanted
        self.framer, self.write = binding.make_framer(), peer.write
        self.log = ClientLog(peer.name, controller.wire_log)
        self._inbox = Inbox(self.log)
        self.arrow_releases = ArrowReleases(controller, binding.surface, self._inbox, binding.releases_by_stop)
        self.command_runner = CommandRunner(controller, binding, session, activity, self.log, rights)
        self._reply_cache = self.command_runner.reply_cache
        #: The task of the command that waits for the mount, and the tasks of commands whose reply is too late.
        self._task: asyncio.Task[None] | None = None
        self._detached_tasks: set[asyncio.Task[None]] = set()
        #: The command that waits for the mount, and whether it waits without a timeout until the next command arrives.
        self._waiting_command: PendingCommand | None = None
        self._waits_past_timeout = False
        self.is_open = True
        #: Whether the next byte begins a command.
        self._between_commands = True
        #: The end of the last reply, which some programs on a network do not read.
        self.unread_text = UnreadText(self._send, self.log, controller.loop, binding.hold_time if peer.hang_up else 0.0)
        #: Changes the baud rate; None if the connection is no serial port.
        self._baud_trial = None if peer.change_baud is None else BaudTrial(peer.change_baud)
        subscriptions, unsent = self.surface.subscriptions(session), lambda: self.write(b"") or 0
        self._pusher = ReadingPusher(
            subscriptions, self.command_runner.read_for_client, self._send, unsent, controller.spawn
        )

    @property
    def has_running_operations(self) -> bool:
        """Whether an operation of this client is still under way."""
        return self._task is not None or bool(self._detached_tasks) or bool(self.command_runner.background)

    @property
    def all_answered(self) -> bool:
        """Whether no command waits for its turn or for the mount."""
        return self._task is None and not self._inbox

    def apply_profile(self, profile: ClientProfile) -> None:
        """Apply the profile of the client's program, which was recognised just now."""
        self.session.use_program_settings(profile.settings)
        self.command_runner.equinox_converter = profile.converter or self.command_runner.equinox_converter
        self.unread_text.hold_time, self.arrow_releases.sends_stop_all = profile.hold_time, profile.releases_by_stop
        self.log.note(f"recognised client {profile.program}: applying its profile")

    # --- bytes in ---------------------------------------------------------------------------------------------------

    def feed(self, data: bytes, stop_count: int | None = None, arrived_at: float | None = None) -> None:
        """Process received bytes; if ``data`` is empty, the bytes that the framer has held back.

        ``stop_count``: if the bytes waited unread, how often the mount had been stopped when the client sent them.
        ``arrived_at``: if the bytes were held back, the loop time of their arrival.
        """
        self.activity.sent_data |= stop_count != STALE_STOP_COUNT
        if self.log.sinks and data:
            self.log.put("raw", data)
        if self.unread_text.hold_time:
            self.unread_text.note_received(data)
        if self._between_commands and self._task is None and self._answer_from_cache(data):
            return
        arrived_at = self.controller.now() if arrived_at is None else arrived_at
        frames = self.framer.feed(data, arrived_at)
        if self.log.sinks:
            self._log_dropped_bytes()
        self._between_commands = self.framer.idle  # else the next bytes may belong to these
        if self.framer.holds_bytes:
            self.controller.loop.call_later(RESYNC_GAP, self._feed_held_bytes, stop_count)
        ended: set[bytes] = set()  # frames that ended a motion, with no other command since
        for frame in frames:
            if isinstance(frame, Unterminated):
                self.log.note(frame.refusal_text)
            if self._baud_trial is not None and self.surface.protocol.find(frame) is not None:
                self._baud_trial.confirm()
            if frame in ended:
                self.log.put("x", frame, "repeated with nothing in between: carried out once for both")
                continue
            ending = self.surface.urgent_end(self.session, frame)
            if ending is None:
                ended.clear()
            else:
                ended.add(frame)
                self._end_motion(frame, ending, arrived_at)
            steps = self.surface.handle(self.session, frame)
            before = self._wanted_state.value.stop_count if stop_count is None else stop_count
            self._inbox.add(PendingCommand(frame, steps, before, ending, arrived_at))
        if self._waits_past_timeout and self._inbox and self._waiting_command is not None:
            self._give_up(self._waiting_command)
        if self._task is None:
            self._answer_waiting_commands()

    def _feed_held_bytes(self, stop_count: int | None) -> None:
        """Process the bytes that the framer still holds back, unless the connection is closed."""
        if self.is_open and self.framer.holds_bytes:
            self.feed(b"", stop_count)

    def _answer_from_cache(self, data: bytes) -> bool:
        """Send the cached reply to the command ``data`` if it is still valid. Return whether it was sent."""
        controller = self.controller
        now = controller.now()
        cached = self._reply_cache.look_up(data, now)
        if cached is None:
            return False
        reply, kinds = cached
        controller.touch(kinds, now)  # a cached reply counts as interest in its readings
        self.session.last_frame = data
        if self.log.sinks:
            self.log.put(">", data)
            self.log.put("<", reply)
        self.write(reply)
        return True

    def _end_motion(self, frame: bytes, ending: UrgentEnd, arrived_at: float) -> None:
        """End a motion ahead of all waiting commands, and remove the waiting commands that would begin it."""
        ends = self.arrow_releases.find_end(frame, ending, arrived_at, self._waiting_command)
        if ends is None:
            return
        self._inbox.cancel(ends.discarded, frame)
        if isinstance(ends.operation, AbortMotion):
            if not (self.arrow_releases.sends_stop_all and self.controller.reconciler.treat_as_release(self.activity)):
                self.controller.begin_stop(self.activity.host)
        else:
            self.command_runner.background.start(ends.operation, self._wanted_state.value.stop_count, arrived_at)

    def _log_dropped_bytes(self) -> None:
        for why, data in self.framer.dropped.items():
            self.log.put("x", bytes(data), why)

    # --- commands in order ------------------------------------------------------------------------------------------

    def _answer_waiting_commands(self) -> None:
        """Answer waiting commands until a command must wait for the mount, or the gateway closes."""
        while self._inbox and not self.controller.context.closed:
            pending = self._inbox.take()
            try:
                wanted = self.command_runner.advance(pending, None)
            except StopIteration as end:
                again = self._inbox.take_repeated(pending.frame) if pending.has_ended_motion else 0
                self._answer(pending, end.value * (1 + again) if end.value else None)
                continue
            except Exception as error:  # a defect must cost a single command, never the client's connection
                self.command_runner.handle_defect(pending.frame, error)
                continue
            self._task, self._waiting_command = self.controller.loop.create_task(self._finish(pending, wanted)), pending
            until = pending.arrived_at + MOUNT_TIMEOUT
            if self.controller.now() < until:
                pending.timeout_timer = self.controller.loop.call_at(until, self._give_up, pending)
                return
            self._detach(pending)

    def _give_up(self, pending: PendingCommand) -> None:
        """Continue with the next command, as the mount is too late; a long operation waits until one has come."""
        self._waits_past_timeout = pending.is_long_operation and not self._inbox
        if pending is self._waiting_command and not self._waits_past_timeout:
            self._detach(pending)
            self._answer_waiting_commands()

    def _detach(self, pending: PendingCommand) -> None:
        """Let the task of this command continue, but send the client the protocol's reply for a silent mount."""
        assert self._task is not None
        self._detached_tasks.add(self._task)
        self._task.add_done_callback(self._detached_tasks.discard)
        self._task, self._waiting_command, pending.is_late = None, None, True
        reply = self.surface.fallback_reply(pending.frame, NoAnswer())
        if not reply:
            self._log_no_reply(pending.frame)
        self._answer(pending, reply)

    async def _finish(self, pending: PendingCommand, operation: Operation) -> None:
        """Finish a command that needs the mount, then continue with the commands that arrived meanwhile."""
        pending.is_reusable = False
        reply = None
        try:
            reply = await self.command_runner.finish(pending, operation)
        except Exception as error:
            self.command_runner.handle_defect(pending.frame, error)
        finally:
            if not pending.is_late:
                self._task = self._waiting_command = None
                self._waits_past_timeout = False
                if pending.timeout_timer is not None:
                    pending.timeout_timer.cancel()
        if pending.is_late:
            self._log_refusal(pending.frame)
            return
        self._answer(pending, reply)
        self._answer_waiting_commands()

    # --- replies out ------------------------------------------------------------------------------------------------

    def _answer(self, pending: PendingCommand, reply: bytes | None) -> None:
        frame, now = pending.frame, self.controller.now()
        self.session.last_frame = frame
        self._log_refusal(frame)
        if not (pending.is_reusable and pending.reading_kinds):
            self._reply_cache.clear()
        elif reply:
            self._reply_cache.store(frame, reply, pending.reading_kinds, now)
        if reply and now - pending.arrived_at > REPLY_TIMEOUT and not pending.is_long_operation:
            reply = None
            self._log_no_reply(frame)
        if reply:
            read = self.surface.protocol.partly_read_replies.get(frame)
            if self.unread_text.hold_time and read is not None:
                reply = self.unread_text.hold_back_rest(reply, read, bool(self._inbox))
            self._send(reply)
        elif self.log.sinks and (why := self.surface.silence_reason(self.session, frame)):
            self.log.note_once(f"no reply to {printable(frame)}: {why}")
        if pending.new_baud is not None and self._baud_trial is not None:
            self._baud_trial.begin(pending.new_baud)

    def _log_no_reply(self, frame: bytes) -> None:
        match = self.surface.protocol.find(frame)
        if match is not None and not match[0].replies:
            return
        self.log.note_once(
            f"no reply to {printable(frame)}: the mount has not answered within "
            f"{REPLY_TIMEOUT} s, and a later answer would be taken for the reply to another command"
        )

    def _log_refusal(self, frame: bytes) -> None:
        if self.session.must_log_refusal:
            self.session.must_log_refusal = False
            self.log.wire_log.refusal_count += 1
        if self.session.refusal_reason:
            why, self.session.refusal_reason = self.session.refusal_reason, ""
            sent = printable(frame.removesuffix(b"\n"))
            self.log.log_refusal_once(f"`{sent}` refused: {why}")

    def _send(self, data: bytes) -> None:
        if data:
            self.log.put("<", data)
            self.write(data)

    def close(self) -> None:
        """End the work for a closed connection: its operations continue, but their replies are dropped."""
        self.is_open = False
        self.write = lambda data: None
        self.unread_text.drop()
        self._pusher.close()
        for frame in self.framer.end():  # the next connection must not continue an incomplete command
            self.log.note(frame.refusal_text)
            deque(self.surface.handle(self.session, frame), 0)
        self._log_dropped_bytes()
        if self._baud_trial is not None:
            self._baud_trial.cancel_fallback()
