"""The Stellarium surface: gotos, which have no reply, and positions, which are pushed.

Every message begins with its length. The only sign of a refused goto is the status in the following positions: it is
negative until a goto is accepted, and after a goto that ended before its goal until the next order. Stellarium 0.22
does not show it; the log has the reason.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gateway.core.errors import Fault, Invalid
from gateway.core.operations import Activity, Equatorial, GetActivity, Goto, Position
from gateway.protocols.base.frames import LengthFramer
from gateway.protocols.base.session import ClientState, Session
from gateway.protocols.base.wants import Handling, Subscription
from gateway.protocols.wireformat.command_set import load

#: Bytes of the header (length and type), and of the longest message that is accepted.
HEADER, LONGEST = 4, 255
#: Seconds from the beginning of a connection to the first position: meanwhile a web browser, which would show these
#: bytes as a broken answer, has sent its request and is recognised.
FIRST = 0.2
#: The values of the field ``status``.
WELL, REFUSED, ENDED_SHORT = 0, -1, -2


class StellariumFramer(LengthFramer):
    """Cuts messages by their length, also messages of an unknown type, which the tables decide about.

    Bytes with an impossible length drop all that arrive with them; after half a message, all until a pause.
    """

    noise = "no Stellarium message begins like this; bytes are accepted again after a pause of 0.1 s"
    half = "half a message, whose rest did not arrive within a second"
    cut_off = "half a message, whose rest did not arrive"
    drops_after_half = True

    def _cut(self, data: bytes) -> list[bytes]:
        frames: list[bytes] = []
        self._pending += data
        while len(self._pending) >= HEADER:
            length = int.from_bytes(self._pending[:2], "little")
            if not HEADER <= length <= LONGEST:
                self.dropped.add(bytes(self._pending), self.noise)
                self._pending.clear()
                self._dropping = True
            elif len(self._pending) < length:
                break
            else:
                frames.append(bytes(self._pending[:length]))
                del self._pending[:length]
        return frames


class Progress(ClientState):
    """``status`` is sent with every position: whether the last goto was accepted, or ended ``short`` of its goal."""

    status: int = WELL
    short: bool = False


class StellariumSession(Session):
    """The session of a Stellarium client."""

    state = Progress
    client: Progress


def goto(session: StellariumSession, values: Mapping[str, Any]) -> Handling:
    """Slew; there is no reply, but the status of the next positions shows whether the goto was accepted."""
    try:
        if not -90.0 <= values["dec"] <= 90.0:
            raise Invalid("the declination is beyond a pole")
        yield Goto(values["ra"], values["dec"])
    except Fault:
        session.client.status = REFUSED
        raise
    session.client.status = WELL


def subscriptions(session: Session) -> Sequence[Subscription]:
    """Return the subscription of the position, and the subscription that notes whether the last goto ended short."""
    assert isinstance(session, StellariumSession)
    pushed = load("stellarium").commands["position"]
    assert pushed.pushed is not None
    template = pushed.replies[0][1]

    def message(position: Equatorial) -> bytes:
        now = round(session.clock() * 1e6)
        status = ENDED_SHORT if session.client.short and not session.client.status else session.client.status
        return template.encode({"time": now, "ra": position.ra, "dec": position.dec, "status": status})

    def note(activity: Activity) -> bytes:
        session.client.short = bool(activity.short)
        return b""

    every = pushed.pushed
    return [Subscription(GetActivity(), every, note), Subscription(Position(), every, message, first_delay=FIRST)]
