"""The Stellarium surface: gotos, which have no reply, and positions, which nobody asks for.

The only word a program gets for a refused goto is the status of the positions that follow it: below 0 until a goto is
accepted. Stellarium 0.22 does not show it; the log tells the reason.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gateway.core.errors import Fault, Invalid
from gateway.core.operations import Equatorial, Goto, Position
from gateway.protocols.base.session import Kept, Session
from gateway.protocols.base.wants import Handling, Subscription
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import load

#: Seconds after the beginning of a connection until the first position: by then a web browser, which takes these bytes
#: for a broken answer, has said what it is.
FIRST = 0.2
#: The values of the field ``status``.
WELL, REFUSED = 0, -1


class Progress(Kept):
    """``status`` is what every position tells it: what became of its last goto."""

    status: int = WELL


class StellariumSession(Session):
    """One client."""

    state = Progress
    kept: Progress


def goto(session: StellariumSession, command: Command, values: Mapping[str, Any]) -> Handling:
    """Nothing is answered; the status of the next positions tells whether it was accepted."""
    try:
        if not -90.0 <= values["dec"] <= 90.0:
            raise Invalid("the declination is beyond a pole")
        yield Goto(values["ra"], values["dec"])
    except Fault:
        session.kept.status = REFUSED
        raise
    session.kept.status = WELL


def subscriptions(session: Session) -> Sequence[Subscription]:
    """The position, again and again."""
    assert isinstance(session, StellariumSession)
    told = load("stellarium").commands["position"]
    assert told.pushed is not None
    picture = told.replies[0][1]

    def message(seen: Equatorial) -> bytes:
        now = round(session.clock() * 1e6)
        return picture.encode({"time": now, "ra": seen.ra, "dec": seen.dec, "status": session.kept.status})

    return [Subscription(Position(), told.pushed, message, after=FIRST)]
