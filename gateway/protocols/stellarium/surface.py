"""The Stellarium surface: gotos, which have no reply, and positions, which nobody asks for.

Every message begins with its length, whatever type it is. The only word a program gets for a refused goto is the status
of the positions that follow it: below 0 until a goto is accepted. Stellarium 0.22 does not show it; the log tells the
reason.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gateway.core.errors import Fault, Invalid
from gateway.core.operations import Equatorial, Goto, Position
from gateway.protocols.base.frames import LengthFramer
from gateway.protocols.base.session import Kept, Session
from gateway.protocols.base.wants import Handling, Subscription
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import load

#: Bytes of the length and the type, and of the longest message that is believed.
HEADER, LONGEST = 4, 255
#: Seconds after the beginning of a connection until the first position: by then a web browser, which takes these bytes
#: for a broken answer, has said what it is.
FIRST = 0.2
#: The values of the field ``status``.
WELL, REFUSED = 0, -1


class Framer(LengthFramer):
    """Cuts messages out by their length. One of another type is cut out as a whole and left to the tables.

    A length that no message has drops what comes with it, and after half a message nothing counts until the line is
    quiet.
    """

    noise = "no message of Stellarium begins so; what follows counts again after 0.1 s of quiet"
    half = "half a message, whose rest did not come within a second"
    cut_off = "half a message, whose rest did not come"
    wary = True

    def _cut(self, data: bytes) -> list[bytes]:
        frames: list[bytes] = []
        self._pending += data
        while len(self._pending) >= HEADER:
            length = int.from_bytes(self._pending[:2], "little")
            if not HEADER <= length <= LONGEST:
                self.dropped.add(bytes(self._pending), self.noise)
                self._pending.clear()
                self._lost = True
            elif len(self._pending) < length:
                break
            else:
                frames.append(bytes(self._pending[:length]))
                del self._pending[:length]
        return frames


class Progress(Kept):
    """``status`` is what every position tells it: what became of its last goto."""

    status: int = WELL


class StellariumSession(Session):
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
    template = told.replies[0][1]

    def message(seen: Equatorial) -> bytes:
        now = round(session.clock() * 1e6)
        return template.encode({"time": now, "ra": seen.ra, "dec": seen.dec, "status": session.kept.status})

    return [Subscription(Position(), told.pushed, message, after=FIRST)]
