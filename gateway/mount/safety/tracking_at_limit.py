"""Tracking that carries the tube to a limit is switched off; a mount that rests there is told of once, and left.

It may track again, by its keys or because it was unparked: then it is switched off again.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Coroutine
from typing import NamedTuple

from gateway.core import operations as op
from gateway.core.errors import Fault, Unsupported
from gateway.mount.safety.inputs import MountInputs

#: How old the word of the mount may grow that it is not aligned, or does not track.
STATUS_AGE = 5.0


class Actions(NamedTuple):
    """What the watch may do: stop the mount, switch its tracking off, ask it something, forget the syncs so far."""

    stop: Callable[[], object]
    tracking_off: Callable[[], Awaitable[object]]
    status: Callable[[], Awaitable[op.Status]]
    ask_status: Callable[[], object]
    ask_side: Callable[[], object]
    forget_syncs: Callable[[], object]
    spawn: Callable[[Coroutine[object, object, None]], object]


class TrackingAtLimit:
    """``switch_off`` is called when nobody moves the mount and it comes nearer to a limit all the same."""

    def __init__(self, mount: MountInputs, actions: Actions) -> None:
        self._mount, self._do = mount, actions
        self._switching = self._helpless = self._resting = self._set_there = False

    def began(self) -> None:
        """A motion has begun: what was found before is not true for ever."""
        self._helpless = self._resting = self._set_there = False

    def under_another_sky(self) -> None:
        """Its site or clock was set while it rested: a limit that it is beyond now it has not come to by itself."""
        self._set_there = True

    def seen(self, status: op.Status | None) -> None:
        """What the mount said of itself last, None while it must be asked anew."""
        if status is None or status.tracking is not op.Tracking.OFF:
            self._resting = False

    def switch_off(self, reason: str) -> None:
        """It has come to this limit."""
        age = self._mount.readings.age(op.GetStatus, self._mount.now())
        if self._resting and age > STATUS_AGE:
            self._do.ask_status()
        elif not (self._switching or self._helpless or self._resting):
            self._switching = True
            self._do.spawn(self._switch_off(reason))

    async def _switch_off(self, reason: str) -> None:
        say = self._mount.transcript
        try:
            if (await self._do.status()).tracking is op.Tracking.OFF:
                say.note("mount", f"WARNING: the mount is at {reason}; its tracking is off, nothing can be stopped")
                self._resting = True
                return
            await self._do.tracking_off()
            say.note("mount", f"tracking is off: it came to {reason}")
        except Unsupported:
            self._helpless = True
            say.note("mount", f"{'WARNING: the mount is' if self._set_there else 'stopped'} at {reason}")
            say.note_once("mount", "the tracking of this mount cannot be switched off at a limit")
            if not self._set_there:
                self._do.stop()
        except Fault as fault:
            say.note("mount", f"tracking goes on beyond {reason}: {fault}")
        finally:
            self._switching = False
