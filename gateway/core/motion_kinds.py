"""Operations by what they do to the motion of a mount: what begins it, what ends it, which of two counts.

It is decided here once, for every protocol.
"""

from __future__ import annotations

from gateway.core import operations as op

GOTOS = (op.Goto, op.GotoHorizontal, op.GotoAxes, op.Park, op.Home)
#: What moves it as long as a key is pressed, or less: begun late it would be begun when nobody wants it any more.
BY_HAND = (op.Move, op.MoveAxis, op.Pulse, op.PulseAxis)
#: What can set the mount moving: a killed gateway leaves it so. An LX200GPS that is to note its home looks for it.
MOVING = (*GOTOS, op.Move, op.MoveAxis, op.Pulse, op.PulseAxis, op.SetHome)
MOTIONS = (
    *GOTOS, op.AbortSlew, op.Sync, op.Move, op.MoveAxis, op.StopAxis, op.Pulse, op.PulseAxis, op.SetTracking,
    op.TrackRate, op.SetHome, op.Unpark, op.Hibernate, op.Wake, op.Focus, op.Choose,
)  # fmt: skip
#: What ends a motion before anything else is begun, and what then begins anew when it was half done.
ENDS = (op.StopAxis, op.AbortSlew)
BEGUN_ANEW = (op.Move, op.MoveAxis, op.SetTracking, op.TrackRate)


def axis_moved(operation: op.Operation) -> int | None:
    """The axis that an operation sets moving by hand, or None."""
    return operation.axis if isinstance(operation, op.Move | op.MoveAxis) else None


def ends_focus(operation: object) -> bool:
    """Whether the focuser is to stand still: a stop of the mount does not see to that."""
    return isinstance(operation, op.Focus) and operation.direction == 0


def survives_abort(operation: op.Operation) -> bool:
    """Whether a stop of the mount leaves it alone: it is no motion, or ends that of the focuser."""
    return operation.survives_abort or ends_focus(operation)


def begins_motion(operation: object) -> bool:
    """Whether the mount or its focuser is set moving by this."""
    return isinstance(operation, MOVING) or (isinstance(operation, op.Focus) and operation.direction != 0)


def may_begin_motion(names: list[str]) -> bool:
    """Whether one of the operations of these names sets the mount moving."""
    return any(issubclass(kind, MOVING) for name in names if (kind := op.named(name)) is not None)
