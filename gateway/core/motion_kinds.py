"""Groups of operations: those that begin a motion, those that end one, and those that a stop does not cancel."""

from __future__ import annotations

from gateway.core import operations as op

GOTOS = (op.Goto, op.GotoHorizontal, op.GotoAxes, op.Park, op.Home)
#: Motions that end when the user releases a key, or by themselves. They never begin late: by then the key is released.
HAND_MOTIONS = (op.Move, op.MoveAxis, op.Pulse, op.PulseAxis)
#: Operations whose motion continues if the gateway is killed. (``SetHome``: an LX200GPS moves to find its home.)
MOVERS = (*GOTOS, op.Move, op.MoveAxis, op.Pulse, op.PulseAxis, op.SetHome)
#: Operations that the reconciler carries out one after the other, because they share the motors or the target.
SEQUENTIAL_ORDERS = (
    *GOTOS, op.AbortSlew, op.Sync, op.Move, op.MoveAxis, op.StopAxis, op.Pulse, op.PulseAxis, op.SetTracking,
    op.TrackRate, op.SetHome, op.Unpark, op.Hibernate, op.Wake, op.Focus, op.Choose,
)  # fmt: skip
#: Orders that end a motion. They may interrupt an order of ``RESUMABLE_ORDERS``, which then begins again.
END_ORDERS = (op.StopAxis, op.AbortSlew)
RESUMABLE_ORDERS = (op.Move, op.MoveAxis, op.SetTracking, op.TrackRate)


def moved_axis(operation: op.Operation) -> int | None:
    """Return the axis that an operation moves by hand, or None."""
    return operation.axis if isinstance(operation, op.Move | op.MoveAxis) else None


def stops_focuser(operation: object) -> bool:
    """Whether the operation halts the focuser. (A stop of the mount does not.)"""
    return isinstance(operation, op.Focus) and operation.direction == 0


def survives_abort(operation: op.Operation) -> bool:
    """Whether a stop of the mount does not cancel the operation: it is no motion, or halts the focuser."""
    return operation.survives_abort or stops_focuser(operation)


def begins_motion(operation: object) -> bool:
    """Whether the operation sets the mount or its focuser moving."""
    return isinstance(operation, MOVERS) or (isinstance(operation, op.Focus) and operation.direction != 0)


def may_begin_motion(operation_names: list[str]) -> bool:
    """Whether any of the operations with these names sets the mount moving."""
    return any(issubclass(kind, MOVERS) for name in operation_names if (kind := op.operation_class(name)) is not None)
