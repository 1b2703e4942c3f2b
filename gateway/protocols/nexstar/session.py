"""What one client of the NexStar surface has set for itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from gateway.protocols.base.session import Kept, Session


@dataclass(slots=True)
class NexStarKept(Kept):
    """``axis_goto`` is where this client has sent single axes (1, 2) since its last goto, degrees."""

    axis_goto: Mapping[int, float] = field(default_factory=dict)


class NexStarSession(Session):
    """A client of the NexStar surface."""

    state = NexStarKept
    kept: NexStarKept
