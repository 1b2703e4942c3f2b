"""The Stellarium surface: it receives gotos, which have no reply, and sends positions at regular intervals.

Every message begins with its length. A refused goto is only visible in the status of the following positions, which is
negative until the next accepted goto. A goto that ended before its goal makes the status negative until any client's
next order. Stellarium 0.22 does not show the status; the log has the reason.
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
HEADER_BYTES, MAX_MESSAGE_BYTES = 4, 255
#: Seconds from the beginning of a connection to the first position. A web browser sends its request in this time and is
#: recognised; it would show a position as a broken answer.
FIRST_DELAY = 0.2
#: The values of the field ``status``.
STATUS_OK, STATUS_REFUSED, STATUS_FAILED = 0, -1, -2


class StellariumFramer(LengthFramer):
    """Cuts a byte stream into messages by their lengths, whatever their type.

    After an impossible length, and when the rest of a message is late, it drops all bytes until a pause.
    """

    noise_reason = "no Stellarium message begins like this; bytes are accepted again after a pause of 0.1 s"
    partial_reason = "half a message, whose rest did not arrive within a second"
    cut_off_reason = "half a message, whose rest did not arrive"
    drops_after_partial = True

    def _cut_commands(self, data: bytes) -> list[bytes]:
        frames: list[bytes] = []
        self._pending += data
        while len(self._pending) >= HEADER_BYTES:
            length = int.from_bytes(self._pending[:2], "little")
            if not HEADER_BYTES <= length <= MAX_MESSAGE_BYTES:
                self.dropped.add(bytes(self._pending), self.noise_reason)
                self._pending.clear()
                self._dropping = True
            elif len(self._pending) < length:
                break
            else:
                frames.append(bytes(self._pending[:length]))
                del self._pending[:length]
        return frames


class StellariumClientState(ClientState):
    """The state of a client: the outcome of its gotos, which the status of every position reports."""

    status: int = STATUS_OK  # whether its last goto was accepted
    ended_short: bool = False  # the mount's last goto ended before its goal


class StellariumSession(Session):
    """The session of a Stellarium client."""

    client_state_type = StellariumClientState
    client: StellariumClientState


def goto(session: StellariumSession, values: Mapping[str, Any]) -> Handling:
    """Slew; there is no reply, but the status of the next positions shows whether the goto was accepted."""
    try:
        if not -90.0 <= values["dec"] <= 90.0:
            raise Invalid("the declination is beyond a pole")
        yield Goto(values["ra"], values["dec"])
    except Fault:
        session.client.status = STATUS_REFUSED
        raise
    session.client.status = STATUS_OK


def subscriptions(session: Session) -> Sequence[Subscription]:
    """Return two subscriptions: one sends the position, the other notes whether the last goto ended before its goal."""
    assert isinstance(session, StellariumSession)
    pushed = load("stellarium").commands["position"]
    assert pushed.pushed is not None
    template = pushed.replies[0][1]

    def message(position: Equatorial) -> bytes:
        now = round(session.clock() * 1e6)
        status = STATUS_FAILED if session.client.ended_short and not session.client.status else session.client.status
        return template.encode({"time": now, "ra": position.ra, "dec": position.dec, "status": status})

    def note(activity: Activity) -> bytes:
        session.client.ended_short = bool(activity.short)
        return b""

    every = pushed.pushed
    return [Subscription(GetActivity(), every, note), Subscription(Position(), every, message, first_delay=FIRST_DELAY)]
