"""What one client of the NexStar surface has set for itself."""

from __future__ import annotations

from collections.abc import Mapping

from gateway.protocols.base.session import Kept, Session


class NexStarKept(Kept):
    """``axis_goto`` is where this client has sent single axes (1, 2) since its last goto, degrees."""

    axis_goto: Mapping[int, float] = {}


class NexStarSession(Session):
    """A client of the NexStar surface."""

    state = NexStarKept
    kept: NexStarKept
