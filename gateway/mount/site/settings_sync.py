"""Tells the mount what was set, as soon as it can hear it; what it has not heard yet is owed (``mount/site/owed.py``).

Site and clock are told one after the other, never mixed with each other, and only while the policy and the alignment
allow it. Nothing is told to another mount than the one it was meant for, nor over a value that somebody else has given
the mount meanwhile. What is given up is said in the log, and reads tell the mount's own value again.
"""

from __future__ import annotations

import asyncio
import contextlib

from gateway.core import operations as op
from gateway.core.errors import Busy, Fault, NoAnswer, Unsupported
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner
from gateway.mount.link.queue import READ, SETTING
from gateway.mount.readings.reader import Reader
from gateway.mount.site import owed as debts
from gateway.mount.site.owed import BUSY, LOOK, TRIES, Kind, Owed, Setting, kind_of

#: In words, for the log.
_NAMES: dict[type[op.Operation], str] = {
    op.SetSite: "site",
    op.SetClock: "clock",
    op.SetGuideRate: "guide rate",
    op.Backlash: "backlash",
    op.PeriodicError: "periodic error correction",
}
#: A clock that shows what was set, but for the seconds that it took, needs not be told again.
CLOCK_SAME = 2.0
#: Of so many that were sent before, a part may still be what the mount tells.
REMEMBERED = 8


class SyncSettings:
    """``owe`` takes what is to be told; ``doubt`` when the line comes up, ``resume`` when the mount is known again."""

    def __init__(self, context: Context, runner: DriverRunner, reader: Reader) -> None:
        self._context, self._driver, self._now, self._link = context, context.driver, context.now, context.link
        self._runner, self._reader, self._site_clock = runner, reader, context.site_clock
        #: What the mount has not been told yet.
        self.owed: Owed = {}
        #: What was sent since the mount told last what it has, by kind; and what is being sent.
        self._sent: dict[Kind, tuple[Setting, ...]] = {}
        self._telling: Kind | None = None
        self._ready = False
        self._mount: tuple[str, str] | None = None
        self._news = asyncio.Event()
        self._task: asyncio.Task[None] | None = None

    def owes(self, operation: op.Operation) -> bool:
        """Whether the mount is being told one of this kind, or is still to be told."""
        return kind_of(operation) in self.owed

    @property
    def sets_sky(self) -> bool:
        """Whether a site or a clock is among it."""
        return any(kind in (op.SetSite, op.SetClock) for kind, _ in self.owed)

    # --- what is owed -----------------------------------------------------------------------------------------------

    def owe(self, operation: op.Operation, left: int = TRIES, due: float = 0.0) -> None:
        """Have the mount told, the newest of a kind only."""
        self.owed = debts.owing(self.owed, Setting(operation, self._now(), left, due))
        if self._link.state in ("down", "opening"):
            self._note(operation, "the mount cannot listen now and is told when it can")
        self._begin()

    async def now_or_later(self, operation: op.Operation) -> None:
        """Tell the mount at once; where it cannot hear, also when it can. Raises Fault."""
        self.owed = {kind: one for kind, one in self.owed.items() if kind != kind_of(operation)}
        sent = self._hears()
        try:
            await self._runner.perform(operation, SETTING)
        except (Busy, NoAnswer) as fault:
            tried = sent and isinstance(fault, NoAnswer)
            self.owe(operation, TRIES - 1 if tried else TRIES, self._now() + BUSY)
            raise

    def doubt(self) -> None:
        """The line has come up: what is on it, and what happened meanwhile, is found out first."""
        self._ready = False

    def resume(self) -> None:
        """The mount has said who it is, and where and when."""
        identity: op.Identity | None = self._context.cache.value(op.GetIdentity)
        now = (identity.product, identity.model) if identity is not None else None
        if self._mount is not None and now is not None and now != self._mount:
            for setting in self.owed.values():
                self._give_up(setting, "another mount is on the line")
        self._mount = now or self._mount
        self._ready = True
        self._begin()

    def heard(self, value: op.Place | op.Moment) -> bool:
        """Take what the mount tells of its site or clock -> whether somebody has changed it there: then that counts."""
        told, clock = self._site_clock, isinstance(value, op.Moment)
        kind = kind_of(op.SetClock(0.0, 0.0) if clock else op.SetSite())
        owed, sent = self.owed.get(kind), self._sent.get(kind, ())
        if isinstance(value, op.Moment):
            ours = debts.clock_is_ours(sent, told.running(told.mount_clock), value, self._now())
            changed = told.mount_says_clock(value, ours)
        else:
            changed = told.mount_says_site(value, debts.site_is_ours(sent, told.mount_site, value))
        if kind != self._telling:
            self._sent.pop(kind, None)
        if changed:
            self._context.note(f"the {'clock' if clock else 'site'} was changed at the mount; it is in force here, too")
            if owed is not None:
                self.owed = debts.without(self.owed, owed)
        return changed

    # --- telling ----------------------------------------------------------------------------------------------------

    def _begin(self) -> None:
        self._news.set()
        if self.owed and (self._task is None or self._task.done()):
            self._task = self._context.tasks.spawn(self._run())

    def _hears(self) -> bool:
        return self._ready and self._link.state == "up" and not self._driver.asleep

    def _disturbs(self, setting: Setting, now: float) -> bool:
        """A date that nobody waits for any more is not told while something moves: a classic is blind afterwards."""
        return isinstance(setting.value, op.SetClock) and now - setting.since > LOOK and self._context.movement.anything

    async def _run(self) -> None:
        """Tell what is owed until nothing is, or the line is down: then ``resume`` begins anew."""
        while self._ready and self._link.state not in ("down", "opening"):
            self._news.clear()
            now = self._now()
            step = debts.next_setting(self.owed, now)
            if step is None:
                return
            if isinstance(step, Setting) and self._hears() and not self._disturbs(step, now):
                await self._tell(step)
                continue
            pause = LOOK if isinstance(step, Setting) else step - now
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(pause):
                    await self._news.wait()

    async def _tell(self, setting: Setting) -> None:
        value = setting.value
        place = isinstance(value, op.SetSite | op.SetClock)
        tried = False
        try:
            if place and not await self._to_be_told(setting):
                self.owed = debts.without(self.owed, setting)
                return
            if place and setting.late and await self._is_there(setting):
                return
            if self.owed.get(kind_of(value)) is not setting or not self._hears():
                return  # a newer one has come, or the line has gone
            tried = True
            self._telling = kind_of(value)
            self._sent[self._telling] = (*self._sent.get(self._telling, ())[-REMEMBERED:], setting)
            await self._runner.perform(setting.running(self._now()), SETTING)
        except Busy:
            self.owed = debts.later(self.owed, setting, self._now() + BUSY)
        except NoAnswer as fault:
            if not tried:
                self.owed = debts.later(self.owed, setting, self._now() + BUSY)
            elif setting.left > 1:
                self.owed = debts.in_vain(self.owed, setting, self._now())
            else:
                self._give_up(setting, str(fault))
        except Unsupported as fault:
            self._keep(setting, fault)
        except Fault as fault:
            self._give_up(setting, str(fault))
        else:
            await self._done(setting)
        finally:
            self._telling = None

    async def may_be_told(self) -> bool:
        """Whether policy and alignment allow that site and clock of the mount are set. Raises Fault."""
        if self._context.policy.site_time == "never":
            return False
        status = await self._reader.read(op.GetStatus())
        return (
            not status.aligned
            or self._driver.takes_site_aligned
            or (self._context.policy.site_time == "always" and not self._driver.loses_alignment)
        )

    async def _to_be_told(self, setting: Setting) -> bool:
        """Whether policy and alignment allow it; else it is kept in the gateway, and the log says so. Raises Fault."""
        what = _NAMES[type(setting.value)]
        if self._context.policy.site_time == "never":
            self._context.note_once(f"the {what} that was set is kept in the gateway (site-time = never)")
            return False
        status = await self._reader.read(op.GetStatus())
        if not status.aligned or self._driver.takes_site_aligned:
            return True
        if self._shows(setting.running(self._now())):
            return False
        if await self.may_be_told():
            return True
        self._context.note_once(f"the mount is aligned: the {what} that was set is kept in the gateway")
        return False

    def _shows(self, running: op.Operation) -> bool:
        """Whether this is what the mount has told of its site or clock."""
        if isinstance(running, op.SetClock):
            return self._site_clock.same_clock(running, CLOCK_SAME)
        return isinstance(running, op.SetSite) and self._site_clock.same_site(running)

    async def _is_there(self, setting: Setting) -> bool:
        """Ask the mount what it has -> whether that is what was set, or somebody else's value. Raises Fault."""
        running = setting.running(self._now())
        kind: op.Operation = op.GetClock() if isinstance(running, op.SetClock) else op.GetSite()
        changed = self.heard(await self._runner.perform(kind, READ))
        same = self._shows(running)
        if same and not changed:
            self._over(setting)
        return same or changed

    async def _done(self, setting: Setting) -> None:
        """It was heard: from now on that is the mount's own; its clock is looked at, for it counts whole seconds."""
        running = setting.running(self._now())
        if isinstance(running, op.SetSite):
            assert running.latitude is not None and running.longitude is not None
            self._site_clock.mount_says_site(op.Place(running.latitude, running.longitude), ours=True)
        elif isinstance(running, op.SetClock):
            self._site_clock.mount_says_clock(op.Moment(running.unix, running.offset, running.dst), ours=True)
            with contextlib.suppress(Fault):  # it is read again when somebody asks
                told: op.Moment = await self._runner.perform(op.GetClock(), READ)
                self._site_clock.mount_says_clock(told, ours=True)
        self._over(setting)

    def _over(self, setting: Setting) -> None:
        """The mount has it: what was kept for programs meanwhile is no longer needed, unless it is newer."""
        newest = self.owed.get(kind_of(setting.value)) is setting
        self.owed = debts.without(self.owed, setting)
        self._sent.pop(kind_of(setting.value), None)
        if newest:
            self._site_clock.forget(setting.value)

    def _keep(self, setting: Setting, fault: Fault) -> None:
        """This mount has no place for it: the gateway has."""
        self.owed = debts.without(self.owed, setting)
        if isinstance(setting.value, op.SetSite | op.SetClock):
            self._context.note(f"{_NAMES[type(setting.value)]} kept in the gateway: {fault}")
        else:
            self._note(setting.value, str(fault))

    def _give_up(self, setting: Setting, why: str) -> None:
        """It is told no more: from now on reads tell what the mount has."""
        newest = self.owed.get(kind_of(setting.value)) is setting
        self.owed = debts.without(self.owed, setting)
        if newest and self._site_clock.has_own(setting.value):
            self._site_clock.forget(setting.value)
            self._note(setting.value, f"it is not in force: {why} The mount's own is told again")
        else:
            self._note(setting.value, f"the mount was not told: {why}")

    def _note(self, operation: op.Operation, text: str) -> None:
        self._context.note(f"the {_NAMES[type(operation)]} that was set: {text}")
