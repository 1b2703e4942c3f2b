"""A simulated SynScan read past the gateway, and what INDI's SynScan drivers show of a mount.

A SynScan's coordinates are of J2000. INDI's drivers convert them to the date of this computer, with aberration,
whatever the mount's own clock says, so the truth is converted by the same rule before it is compared.
"""

from __future__ import annotations

import datetime
from typing import Any

from .hand_control import HandControl
from .sky import NIGHT, Spot, apparent, of_2000, of_date


class SynScan(HandControl):
    """The hand control of Sky-Watcher: a HandControl whose position is of J2000."""

    def position(self) -> Spot:
        """Of the date of the mount's own clock, as every other mount tells it."""
        return of_date(super().position(), NIGHT)


class AsShown:
    """A mount whose position is what INDI shows for it today; everything else is the mount's own."""

    def __init__(self, truth: Any) -> None:
        self._truth = truth

    def position(self) -> Spot:
        return apparent(of_2000(self._truth.position(), NIGHT), datetime.datetime.now(datetime.UTC))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._truth, name)
