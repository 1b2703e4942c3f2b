"""What the gateway knows of a mount without asking it: what moves by its orders, and what the mount can do.

Abilities follow from the tables, by the model and version that the mount has told.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gateway.core import operations as op
from gateway.core.errors import Unsupported
from gateway.mount.context import Context
from gateway.mount.motion.wanted import ByHand, Slew, WantedState
from gateway.mount.readings.reader import Reader
from gateway.mount.site.astrometry import SiteAstrometry


class Standing:
    """``handlers`` answers the reads of this kind."""

    def __init__(self, context: Context, reader: Reader, wanted: WantedState, astrometry: SiteAstrometry) -> None:
        self._context, self._reader, self._wanted, self._astrometry = context, reader, wanted, astrometry
        self.handlers: dict[type[op.Operation], Callable[[Any], Any]] = {
            op.GetActivity: self._activity,
            op.GetAbilities: self._abilities,
            op.TubeSide: self._tube_side,
        }

    async def _activity(self, _: op.GetActivity) -> op.Activity:
        wanted, now, parked = self._wanted.value, self._context.now(), self._context.driver.parked
        slews = isinstance(wanted.motion, Slew)
        waiting = [order.operation for order in wanted.pending if not order.follow_up]
        rest = [order.operation for order in wanted.pending if order.follow_up]
        return op.Activity(
            goto=slews or bool(wanted.waiting_gotos) or (not parked and any(map(_parks, rest))),
            by_hand=isinstance(wanted.motion, ByHand) or any(isinstance(one, op.Move | op.MoveAxis) for one in waiting),
            pulse=any(pulse.until > now for pulse in wanted.pulses)
            or any(isinstance(order.operation, op.Pulse | op.PulseAxis) for order in wanted.pending),
            parked=parked,
            homed=wanted.homed and not slews,
        )

    async def _abilities(self, _: op.GetAbilities) -> op.Abilities:
        equatorial = (await self._reader.read(op.GetStatus())).equatorial
        return self._context.driver.can_do(equatorial)

    async def _tube_side(self, _: op.TubeSide) -> str:
        driver = self._context.driver
        told: str = await self._reader.read(op.PierSide())
        if not driver.german:
            raise Unsupported("Only a German mount has two sides of the pier.")
        if (side := driver.tube_side(told)) is not None:
            return side
        return told if self._astrometry.place().latitude >= 0.0 else {"E": "W", "W": "E"}[told]


def _parks(operation: op.Operation) -> bool:
    """Whether this is the rest of a park: the tube is there, and tracking is not off yet."""
    return getattr(operation, "then", "") == "park"
