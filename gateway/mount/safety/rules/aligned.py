"""Before its alignment nobody knows where a mount points: it is not sent anywhere, and no limit can be watched.

A hand control without alignment acknowledges whatever it is told and does nothing, or moves who knows where.
"""

from __future__ import annotations

from gateway.core import operations as op

UNWATCHED = "not aligned: positions mean nothing yet, so no limit can be watched"


def needs_alignment(operation: op.Operation, sync_aligns: bool, unaligned: str) -> bool:
    """Whether only an aligned mount may be told this; ``unaligned`` is the owner's word on axis readings."""
    by_axes = isinstance(operation, op.GotoAxes | op.GotoHorizontal | op.Park | op.Home)
    if sync_aligns or not (by_axes or isinstance(operation, op.Sync)):
        return False
    return not (by_axes and unaligned == "allow")
