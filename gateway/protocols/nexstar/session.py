"""A client of the NexStar surface: its own settings, and how its motion commands are acknowledged.

No acknowledgement of a motion waits for the mount. While the mount's line is down, a pass-through command gets the
no-response form, and every other command gets no reply, because ``#`` would mean yes. A command that ends a motion is
always acknowledged: the gateway repeats the stop until the mount has received it.
"""

from __future__ import annotations

from collections.abc import Mapping

from gateway.core.errors import Asleep, Fault, NoAnswer
from gateway.core.operations import Operation
from gateway.protocols.base.session import ClientState, Session
from gateway.protocols.base.wants import CheckPossible, FireAndForget, Handling


class NexStarClientState(ClientState):
    """Settings of a client. ``axis_goals``: axis (1, 2) -> the client's goal for it since the last goto, degrees."""

    axis_goals: Mapping[int, float] = {}


class NexStarSession(Session):
    client_state_type = NexStarClientState
    client: NexStarClientState


def begin(operation: Operation) -> Handling:
    """Start an operation without waiting for the mount. Raises Fault if it is already known to be impossible."""
    yield CheckPossible(operation)
    yield FireAndForget(operation)


def attempt(operation: Operation) -> Handling:
    """Carry out an operation; a refusal, or Asleep, is only logged. Raises NoAnswer if the mount does not answer."""
    try:
        yield operation
    except Fault as fault:
        if isinstance(fault, NoAnswer) and not isinstance(fault, Asleep):
            raise
