"""Sends pending settings (``mount/site/pending_settings.py``) to the mount as soon as it is reachable.

Site and clock are sent one after the other, never interleaved, only if the policy and the alignment allow it, and never
to a moving mount. A setting is dropped if another mount is connected, or if the value was changed at the mount
meanwhile. The log says which settings were sent to the mount and for whom, which stay in the gateway, and which failed;
programs then read the mount's own value again, if it is known.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable

from gateway.core import operations as op
from gateway.core.errors import Busy, Fault, NoAnswer, Unsupported
from gateway.core.motion_kinds import GOTOS
from gateway.core.signals import Signal
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner
from gateway.mount.link.queue import READ, SETTING
from gateway.mount.presence import NO_PROGRAM, ProgramId
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.admission.contradictions import log_contradictions, site_text
from gateway.mount.site import pending_settings
from gateway.mount.site.pending_settings import AT_REST, BUSY_DELAY, CHECK_DELAY, TRIES, Kind, Pending, Setting, kind_of

_SETTING_NAMES: dict[type[op.Operation], str] = {
    op.SetSite: "site",
    op.SetClock: "clock",
    op.SetGuideRate: "guide rate",
    op.Backlash: "backlash",
    op.PeriodicError: "periodic error correction",
}


def setting_name(operation: op.Operation) -> str:
    return _SETTING_NAMES[type(operation)]


def note(context: Context, operation: op.Operation, text: str) -> None:
    """Log a line about a setting of a program: for example why it is sent later."""
    context.note(f"the {setting_name(operation)} that was set: {text}")


def note_not_sent(context: Context, setting: Setting, reason: str) -> None:
    """Log, once for each host, that its site or clock is not sent to the mount, and why."""
    context.note_once(
        f"{reason}: the {setting_name(setting.value)} that was set is stored in the gateway, "
        f"for {setting.client_name or 'this computer'} alone; everyone else reads the mount's"
    )


def note_sent(context: Context, setting: Setting, clock_advance: float | None = None) -> None:
    """Log who has set the mount's site or clock (by ``clock_advance`` seconds), and sources that contradict it."""
    by, value = setting.client_name or "the gateway", setting.value
    if isinstance(value, op.SetSite) and value.latitude is not None and value.longitude is not None:
        context.note(
            f"{by} has set the mount's site, for everyone: {site_text(op.Place(value.latitude, value.longitude))}"
        )
    elif clock_advance is not None:
        context.note(f"{by} has set the mount's clock, for everyone: {clock_advance:+.0f} s")
    log_contradictions(context)


#: The orders during which no site or clock is sent.
_MOTION_ORDERS = (*GOTOS, op.Move, op.MoveAxis)
#: Seconds by which the mount's clock may differ from the setting and still count as set.
CLOCK_TOLERANCE = 2.0
#: The number of sent settings of a kind that are stored, because the mount may still report parts of them.
MAX_EARLIER_SETTINGS = 8


class SettingsSender:
    """Sends settings that ``queue`` adds. Call ``pause`` when the line comes up, ``resume`` after identification."""

    def __init__(self, context: Context, runner: DriverRunner, reader: Reader) -> None:
        self._context, self._driver, self._now, self._link = context, context.driver, context.now, context.link
        self._runner, self._reader, self._site_clock = runner, reader, context.site_clock
        self._incoming = context.incoming_settings
        #: Returns whether the position shows a motion that no program has ordered. The controller sets this function.
        self.moved_by_others: Callable[[], bool] = lambda: False
        #: By kind, the settings sent since the mount last reported its value; and the kind that is being sent now.
        self._sent: dict[Kind, tuple[Setting, ...]] = {}
        self._sending: Kind | None = None
        self._is_ready = False
        self._mount_identity: tuple[str, str] | None = None
        self._wake = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        #: Emitted with a setting that the mount has refused, and the reason.
        self.refused: Signal[tuple[Setting, str]] = Signal()

    @property
    def pending(self) -> Pending:
        """The settings that the mount has not received yet."""
        return self._incoming.pending

    @pending.setter
    def pending(self, pending: Pending) -> None:
        self._incoming.pending = pending

    # --- pending settings -------------------------------------------------------------------------------------------

    def queue(
        self, operation: op.Operation, tries: int = TRIES, due_at: float = 0.0, by: ProgramId = NO_PROGRAM
    ) -> None:
        """Queue a setting in place of an older one of its kind. ``due_at``: loop time of the first attempt, 0: now."""
        self.pending = pending_settings.add(self.pending, Setting(operation, self._now(), tries, due_at, by.host))
        if self._link.state in ("down", "opening"):
            note(self._context, operation, "the mount is not connected now; it is sent later")
        self._start()

    async def send_now_or_later(self, operation: op.Operation) -> None:
        """Send a setting at once. Raises Fault. If the mount is busy or does not answer, also queue it for later."""
        self.pending = {kind: setting for kind, setting in self.pending.items() if kind != kind_of(operation)}
        sent = self._is_reachable()
        try:
            await self._runner.perform(operation, SETTING)
        except (Busy, NoAnswer) as fault:
            tried = sent and isinstance(fault, NoAnswer)
            self.queue(operation, TRIES - 1 if tried else TRIES, self._now() + BUSY_DELAY)
            raise

    def pause(self) -> None:
        """Stop sending until ``resume``, because the mount is not identified yet."""
        self._is_ready = False

    def resume(self) -> None:
        """Start sending, after identification and the first reads; give up settings if another mount is connected."""
        identity: op.Identity | None = self._context.cache.last_value(op.GetIdentity)
        reported = (identity.product, identity.model) if identity is not None else None
        if self._mount_identity is not None and reported is not None and reported != self._mount_identity:
            for setting in self.pending.values():
                self._give_up(setting, "another mount is on the line")
        self._mount_identity = reported or self._mount_identity
        self._is_ready = True
        self._start()

    def take_reported_value(self, value: op.Place | op.Moment) -> bool:
        """Store a reported site or clock. Return whether it was changed at the mount; if so, drop a pending one."""
        site_clock, clock = self._site_clock, isinstance(value, op.Moment)
        kind = kind_of(op.SetClock(0.0, 0.0) if clock else op.SetSite())
        unsent, sent = self.pending.get(kind), self._sent.get(kind, ())
        if isinstance(value, op.Moment):
            ours = pending_settings.clock_matches_sent(
                sent, site_clock.present_time(site_clock.mount_clock), value, self._now()
            )
            changed = site_clock.take_mount_clock(value, ours)
        else:
            changed = site_clock.take_mount_site(
                value, pending_settings.site_matches_sent(sent, site_clock.mount_site, value)
            )
        if kind != self._sending:
            self._sent.pop(kind, None)
        if changed:
            self._context.note(f"the {'clock' if clock else 'site'} was changed at the mount; the gateway uses it, too")
            if unsent is not None:
                self.pending = pending_settings.without_setting(self.pending, unsent)
        return changed

    # --- sending ----------------------------------------------------------------------------------------------------

    def _start(self) -> None:
        self._wake.set()
        if self.pending and (self._task is None or self._task.done()):
            self._task = self._context.tasks.spawn(self._run())

    def _is_reachable(self) -> bool:
        return self._is_ready and self._link.state == "up" and not self._driver.asleep

    def _is_in_motion(self) -> bool:
        """Whether anything moves the mount, or a motion is about to begin. Then no site or clock is sent."""
        active = self._context.wanted.value.active_order
        begins = active is not None and isinstance(active.operation, _MOTION_ORDERS)
        return begins or self._context.movement.any_motion or self.moved_by_others()

    async def _run(self) -> None:
        """Send pending settings until none is left, the line is down or ``pause`` is called. ``_start`` restarts it."""
        while self._is_ready and self._link.state not in ("down", "opening"):
            self._wake.clear()
            now = self._now()
            pending: Pending = {kind: setting for kind, setting in self.pending.items() if kind[0] not in AT_REST}
            held_back = len(pending) < len(self.pending) and self._is_in_motion()
            pending = pending if held_back else self.pending
            step = pending_settings.next_setting(pending, now)
            if step is None and not held_back:
                return
            if isinstance(step, Setting) and self._is_reachable():
                await self._send(step)
                continue
            pause = step - now if isinstance(step, float) and not held_back else CHECK_DELAY
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(pause):
                    await self._wake.wait()

    async def _send(self, setting: Setting) -> None:
        value = setting.value
        at_rest = isinstance(value, op.SetSite | op.SetClock)
        tried = False
        try:
            if at_rest and not await self._should_send(setting):
                self.pending = pending_settings.without_setting(self.pending, setting)
                return
            if at_rest and setting.was_delayed and await self._needs_no_sending(setting):
                return
            if self.pending.get(kind_of(value)) is not setting or not self._is_reachable():
                return  # replaced by a newer setting, or the link is down
            if at_rest and self._is_in_motion():
                return  # a motion has begun meanwhile: later
            tried = True
            self._sending, self._incoming.type_being_sent = kind_of(value), type(value) if at_rest else None
            self._sent[self._sending] = (*self._sent.get(self._sending, ())[-MAX_EARLIER_SETTINGS:], setting)
            await self._runner.perform(setting.value_now(self._now()), SETTING)
        except Busy:
            self.pending = pending_settings.with_postponed(self.pending, setting, self._now() + BUSY_DELAY)
        except NoAnswer as fault:
            if not tried:
                self.pending = pending_settings.with_postponed(self.pending, setting, self._now() + BUSY_DELAY)
            elif setting.tries_left > 1:
                self.pending = pending_settings.after_attempt(self.pending, setting, self._now())
            else:
                self._give_up(setting, str(fault))
        except Unsupported as fault:
            self._keep_in_gateway(setting, fault)
        except Fault as fault:
            self._give_up(setting, str(fault))
        else:
            await self._note_acknowledged(setting)
        finally:
            self._sending = self._incoming.type_being_sent = None

    async def may_set_site_or_clock(self) -> bool:
        """Whether policy and alignment allow setting the mount's site and clock. Raises Fault."""
        if self._context.policy.site_time == "never":
            return False
        return self.accepts_site_or_clock(await self._reader.read(op.GetStatus()))

    def accepts_site_or_clock(self, status: op.Status) -> bool:
        """Whether this status of the mount allows sending a site and clock; the owner may still forbid it."""
        driver, policy = self._driver, self._context.policy.site_time
        return not status.aligned or driver.can_set_site_aligned or (policy == "always" and not driver.site_unaligns)

    async def _should_send(self, setting: Setting) -> bool:
        """Whether to send a setting. If not, log why, unless an aligned mount has this value already. Raises Fault."""
        if self._context.policy.site_time == "never":
            note_not_sent(self._context, setting, "site-time = never")
            return False
        status = await self._reader.read(op.GetStatus())
        if not status.aligned or self._driver.can_set_site_aligned:
            return True
        if self._is_set_already(setting.value_now(self._now())):
            return False
        if await self.may_set_site_or_clock():
            return True
        note_not_sent(self._context, setting, "the mount is aligned")
        return False

    def _is_set_already(self, operation: op.Operation) -> bool:
        """Whether the mount already has this site or clock, as last reported or set; False for other settings."""
        if isinstance(operation, op.SetClock):
            return self._site_clock.is_mount_clock(operation, CLOCK_TOLERANCE)
        return isinstance(operation, op.SetSite) and self._site_clock.is_mount_site(operation)

    async def _needs_no_sending(self, setting: Setting) -> bool:
        """Read the mount's value; if equal or changed there, drop the setting and return True. Raises Fault."""
        running = setting.value_now(self._now())
        if isinstance(running, op.SetClock):
            changed = self.take_reported_value(await self._runner.perform(op.GetClock(), READ))
        else:
            changed = self.take_reported_value(await self._runner.perform(op.GetSite(), READ))
        same = self._is_set_already(running)
        if same and not changed:
            self._drop_program_copies(setting)
        return same or changed

    async def _note_acknowledged(self, setting: Setting) -> None:
        """Note that the mount has acknowledged a setting. Read a clock back, because the mount counts whole seconds."""
        running = setting.value_now(self._now())
        is_new = not self._is_set_already(running)
        if isinstance(running, op.SetSite):
            assert running.latitude is not None and running.longitude is not None
            place = op.Place(running.latitude, running.longitude)
            self._site_clock.take_mount_site(place, sent_by_gateway=True, set_by=setting.client_name)
            if is_new:
                note_sent(self._context, setting)
        elif isinstance(running, op.SetClock):
            before = self._site_clock.present_time(self._site_clock.mount_clock)
            self._site_clock.take_mount_clock(
                op.Moment(running.unix, running.offset, running.dst), sent_by_gateway=True, set_by=setting.client_name
            )
            if is_new:
                note_sent(self._context, setting, None if before is None else running.unix - before.unix)
            self._drop_program_copies(setting)
            self._incoming.type_being_sent = None
            with contextlib.suppress(Fault):  # it is read again when needed
                shown: op.Moment = await self._runner.perform(op.GetClock(), READ)
                self._site_clock.take_mount_clock(shown, sent_by_gateway=True)
            return
        self._drop_program_copies(setting)

    def _drop_program_copies(self, setting: Setting) -> None:
        """Forget a setting that the mount has now. Unless a newer one is pending, programs read the mount's value."""
        newest = self.pending.get(kind_of(setting.value)) is setting
        self.pending = pending_settings.without_setting(self.pending, setting)
        self._sent.pop(kind_of(setting.value), None)
        if newest:
            self._site_clock.forget(setting.value)

    def _keep_in_gateway(self, setting: Setting, fault: Fault) -> None:
        """Stop sending a setting that the mount does not support; a site or clock stays stored in the gateway."""
        self.pending = pending_settings.without_setting(self.pending, setting)
        if isinstance(setting.value, op.SetSite | op.SetClock):
            self._context.note(f"{setting_name(setting.value)} stored in the gateway: {fault}")
        else:
            note(self._context, setting.value, str(fault))

    def _give_up(self, setting: Setting, reason: str) -> None:
        """Give up a failed setting; log why. Unless a newer one waits, programs read the mount's value, if known."""
        self.refused.emit((setting, reason))
        newest = self.pending.get(kind_of(setting.value)) is setting
        self.pending = pending_settings.without_setting(self.pending, setting)
        if newest and self._site_clock.has_reported(setting.value):
            self._site_clock.forget(setting.value)
            note(self._context, setting.value, f"it is not in force: {reason} Clients get the mount's own again")
        else:
            note(self._context, setting.value, f"the mount did not receive it: {reason}")
