"""What belongs to one client of a Stellarium surface: what became of its last goto."""

from __future__ import annotations

from gateway.protocols.base.session import Kept, Session

#: The values of the field ``status``.
WELL, REFUSED = 0, -1


class Progress(Kept):
    """``status`` is what every position tells it."""

    status: int = WELL


class StellariumSession(Session):
    """One client."""

    state = Progress
    kept: Progress
