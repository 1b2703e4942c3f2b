"""Why a NexStar cannot be guided by motor sense now, as far as that is known without asking it.

Motors from 6.12 on know guide pulses, which they add to whatever they do. Older ones are given a rate that differs from
equatorial tracking for as long, so a mount that does not track, or tracks in alt-az, cannot be guided so.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gateway.core.errors import Fault, Refused, Unsupported
from gateway.core.operations import Tracking

if TYPE_CHECKING:
    from gateway.protocols.nexstar.driver.state import NexStar

PULSE_FIRMWARE = (6, 12)


def times_pulses(mount: NexStar) -> bool:
    """Whether both motors know guide pulses."""
    return bool(mount.motors) and min(mount.motors.values()) >= PULSE_FIRMWARE


def unguided(mount: NexStar) -> Fault | None:
    """What a guide pulse is refused with, None where it is not."""
    if mount.goto is not None:
        return Refused("The mount is slewing: the guide pulse is dropped.")
    if times_pulses(mount):
        return None
    if mount.stepping:
        return Unsupported("Hand controls before 1.6 have no way to the motors: this mount cannot be guided.")
    if (mount.tracking or Tracking.OFF).equatorial:
        return None
    if not mount.aligned:
        return Unsupported("The mount is not aligned and does not track: the guide pulse is dropped.")
    if mount.german or (mount.native_mode or Tracking.OFF).equatorial:
        return Unsupported("The mount does not track: the guide pulse is dropped. Tracking on, and it is guided.")
    return Unsupported("This mount cannot be guided in alt-az: its motors know no guide pulses.")
