"""A hand control that presents the mount itself: where what the gateway does stands against the mount's own answer.

What the gateway carries out in the place of old motors it tells itself, and axes go through it; other devices on the
mount's bus answer for themselves.
"""

from __future__ import annotations

from gateway.core.operations import Values
from gateway.protocols.nexstar.session import NexStarSession
from gateway.protocols.nexstar.surface.devices import MOTORS

#: Told by the gateway of the motors, which it moves, and by every other device itself.
_AXES = frozenset({"axis_position", "axis_done"})


def stands_against(session: NexStarSession, name: str, values: Values) -> bool:
    """Whether the mount's own answer would contradict what this gateway has told or does."""
    if name in _AXES:
        return values["device"] in MOTORS
    return name == "pulse_active" and MOTORS.get(values["device"]) in session.shared.pulse_ends
