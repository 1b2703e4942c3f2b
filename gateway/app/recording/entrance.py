"""The one way by which anything from outside enters a gateway: connections, their bytes, the mount's bytes, requests.

Without a recording, things enter as they come. With one, they enter at the beginning of a turn of the event loop and
are written down. What the gateway does then follows from what entered, at which turn and at what time, and from nothing
else. Anything new that reaches the gateway from a port, a thread, a file or a process must come this way, too.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Coroutine
from typing import Protocol, TypeVar

from gateway.transport import ConnectionHandler
from gateway.transport.handler import Arrive, Write
from gateway.transport.wires import Transport

_T = TypeVar("_T")
#: What somebody outside wants done, to be begun when it comes in.
Work = Callable[[], Coroutine[object, object, _T]]


class Admitting(Protocol):
    """Where connections of one surface come in."""

    def arrive(self, name: str, host: str, write: Write) -> ConnectionHandler: ...
    def admit(self, name: str, host: str) -> None: ...
    def come(self, name: str, host: str, write: Write) -> ConnectionHandler: ...


class Entrance:
    """Nobody records: everything comes in as it is."""

    def arrive(self, reception: Admitting) -> Arrive:
        """What a port calls when somebody connects."""
        return reception.arrive

    def wire(self, wire: Transport) -> Transport:
        """The way to the mount, as the line sees it."""
        return wire

    def waiting(self, work: Callable[[], Awaitable[None]]) -> Callable[[], Awaitable[None]]:
        """Something outside that the gateway itself waits for, as it may call it."""
        return work

    async def begin(self, begin: Callable[[], None]) -> None:
        begin()

    def tell(self, arrow: str, act: Callable[[], None]) -> None:
        """Something has happened outside that a recording has a letter for: act on it."""
        act()

    async def do(self, arrow: str, work: Work[_T]) -> _T:
        """Somebody outside has something done that a recording has a letter for. Raises what the work raises."""
        return await work()

    async def wish(self, line: str, carry_out: Callable[[str], Coroutine[object, object, str]]) -> str:
        """A person at the command line wishes for something, written on one line."""
        return await carry_out(line)
