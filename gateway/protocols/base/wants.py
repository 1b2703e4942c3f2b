"""What a surface requests while it handles a command: operations, and how they are to be performed.

A handler is a generator: it yields these requests, is sent the answers, and returns the values of the reply. Data that
a surface sends without a command is a subscription, which begins and ends with the connection.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any, NamedTuple

from gateway.core.errors import Fault
from gateway.core.operations import Operation, Read, Values


class FireAndForget(NamedTuple):
    """Perform an operation without waiting for its outcome: the command has no reply."""

    operation: Operation


class CheckPossible(NamedTuple):
    """Check whether an operation could succeed. Raises Fault if the client may not request it, or if the mount does not
    answer. A surface uses this before a reply that reports success in advance.
    """

    operation: Operation


class ReuseLastReading(NamedTuple):
    """Answer with the last reading that this client received, so that both coordinates are of the same moment. If that
    is too old, read again.
    """

    operation: Operation


class Defer(NamedTuple):
    """Call a handler of this surface, by its name in the tables, after some seconds."""

    seconds: float
    handler: str


class ChangeBaudRate(NamedTuple):
    """Change the baud rate after the reply to this command, if the client is on a serial port."""

    baud: int


class Subscription(NamedTuple):
    """Read ``operation`` every ``period`` seconds, encode it with ``encode``, and send the bytes to the client, if any.

    With ``only_changes`` the same bytes are not sent twice in a row. A slow client gets only the newest message.
    Nothing is sent while the mount does not answer. The first message is sent after ``first_delay`` seconds.
    """

    operation: Read
    period: float
    encode: Callable[[Any], bytes]
    only_changes: bool = False
    first_delay: float = 0.0


class Note(NamedTuple):
    """Write a sentence to the log and to ``status``, once: how the gateway deviates from the request."""

    text: str


SurfaceStep = Note | Operation | FireAndForget | CheckPossible | ReuseLastReading | Defer | ChangeBaudRate
Handling = Generator[SurfaceStep, Any, Any]


def decoded(values: Values) -> Values:
    """Return the values of a command unchanged. Raises the Fault in ``values`` if the command could not be decoded."""
    if "fault" in values:
        raise values["fault"]
    return values


def relay_requests(steps: Handling, intercept: Callable[[SurfaceStep], bool]) -> Handling:
    """Pass on the requests of a handler and the answers to them, unless ``intercept`` stops a request.

    ``intercept`` receives each request first. If it returns True, the request is dropped and its answer is None. If it
    raises a Fault, that is raised in the handler.
    """
    answer: object = None
    fault: Fault | None = None
    while True:
        try:
            wanted = steps.send(answer) if fault is None else steps.throw(fault)
        except StopIteration as end:
            return end.value
        answer, fault = None, None
        try:
            if not intercept(wanted):
                answer = yield wanted
        except Fault as error:
            fault = error
