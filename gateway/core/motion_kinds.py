"""Operations grouped by their effect on the motion of a mount: which begin, end or survive it, for every protocol."""

from __future__ import annotations

from gateway.core import operations as op

GOTOS = (op.Goto, op.GotoHorizontal, op.GotoAxes, op.Park, op.Home)
#: Motions that last as long as a key is pressed, or less. They are never begun late: the user has released the key.
HAND_MOTIONS = (op.Move, op.MoveAxis, op.Pulse, op.PulseAxis)
#: What sets the mount moving, even if the gateway is killed then. An LX200GPS that stores its home searches for it.
MOVERS = (*GOTOS, op.Move, op.MoveAxis, op.Pulse, op.PulseAxis, op.SetHome)
MOTIONS = (
    *GOTOS, op.AbortSlew, op.Sync, op.Move, op.MoveAxis, op.StopAxis, op.Pulse, op.PulseAxis, op.SetTracking,
    op.TrackRate, op.SetHome, op.Unpark, op.Hibernate, op.Wake, op.Focus, op.Choose,
)  # fmt: skip
#: What ends a motion before any other order is carried out, and what such an end interrupts and is then begun again.
END_ORDERS = (op.StopAxis, op.AbortSlew)
RESUMABLE_ORDERS = (op.Move, op.MoveAxis, op.SetTracking, op.TrackRate)


def axis_moved(operation: op.Operation) -> int | None:
    """Return the axis that an operation moves by hand, or None."""
    return operation.axis if isinstance(operation, op.Move | op.MoveAxis) else None


def ends_focus(operation: object) -> bool:
    """Whether the operation halts the focuser, which a stop of the mount leaves moving."""
    return isinstance(operation, op.Focus) and operation.direction == 0


def survives_abort(operation: op.Operation) -> bool:
    """Whether a stop of the mount leaves the operation alone: it is no motion, or halts the focuser."""
    return operation.survives_abort or ends_focus(operation)


def begins_motion(operation: object) -> bool:
    """Whether the operation sets the mount or its focuser moving."""
    return isinstance(operation, MOVERS) or (isinstance(operation, op.Focus) and operation.direction != 0)


def may_begin_motion(names: list[str]) -> bool:
    """Whether any of the operations with these names sets the mount moving."""
    return any(issubclass(kind, MOVERS) for name in names if (kind := op.named(name)) is not None)
