"""Which kinds of operations set something moving: decided here once, for every protocol."""

from __future__ import annotations

from gateway import operations as op

GOTOS = (op.Goto, op.GotoHorizontal, op.GotoAxes, op.Park, op.Home)
#: What can set the mount moving: a killed gateway leaves it so.
MOVING = (*GOTOS, op.Move, op.MoveAxis, op.Pulse, op.PulseAxis)


def begins_motion(operation: object) -> bool:
    """Whether the mount or its focuser is set moving by this."""
    return isinstance(operation, MOVING) or (isinstance(operation, op.Focus) and operation.direction != 0)


def may_begin_motion(names: list[str]) -> bool:
    """Whether one of the operations of these names sets the mount moving."""
    return any(issubclass(kind, MOVING) for name in names if (kind := op.named(name)) is not None)
