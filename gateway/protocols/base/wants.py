"""What a surface asks for while it handles a command: operations, and what is to be done with them.

A handler is a generator: it yields these, is sent the answers, and its value is the reply's values. A reply answers a
command; what a surface tells without being asked is a subscription, which begins and ends with the connection.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any, NamedTuple

from gateway.core.errors import Fault
from gateway.core.operations import Operation, Read, Values


class FireAndForget(NamedTuple):
    """Perform an operation without waiting for it: its command has no reply."""

    operation: Operation


class Possible(NamedTuple):
    """Go on unless it is known already that nothing can come of this operation: it may not be asked for, or the mount
    does not hear. Raises Fault then, so that no is said before a yes that would be no more than a guess.
    """

    operation: Operation


class ReuseLastReading(NamedTuple):
    """What this client was told by a read a moment ago, so that two halves are of one instant; else asked anew."""

    operation: Operation


class Defer(NamedTuple):
    """Call a handler of this surface again after some seconds."""

    seconds: float
    special: str


class Speed(NamedTuple):
    """Go on at another baud rate once this command was answered, where there is a serial port."""

    baud: int


class Subscription(NamedTuple):
    """``operation`` is read ``every`` so many seconds, and ``encode`` makes bytes of what it tells; empty: nothing.

    With ``changes`` the same bytes are not sent twice in a row. What the other side has not taken yet is not piled up:
    it gets the newest when it reads again. While the mount does not tell, nothing is sent. The first comes ``after`` so
    many seconds of the connection.
    """

    operation: Read
    every: float
    encode: Callable[[Any], bytes]
    changes: bool = False
    after: float = 0.0


Want = Operation | FireAndForget | Possible | ReuseLastReading | Defer | Speed
Handling = Generator[Want, Any, Any]


def given(values: Values) -> Values:
    """The values of a command. Raises the Fault of those that cannot be read."""
    if "fault" in values:
        raise values["fault"]
    return values


def relayed(steps: Handling, instead: Callable[[Want], bool]) -> Handling:
    """Hand on what a command asks for, and what it is answered.

    ``instead`` is shown everything first. What it returns True for is not asked for, and answered with nothing; a Fault
    that it raises is the answer.
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
            if not instead(wanted):
                answer = yield wanted
        except Fault as error:
            fault = error
