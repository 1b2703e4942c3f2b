"""The single entrance of all input to a gateway: connections, their bytes, the mount's bytes, requests.

Without a recording, input enters as it arrives. With one, it enters at the beginning of an event loop iteration (a
*turn*) and is recorded. Then everything the gateway does is determined by the input and its turns and times. Any new
kind of input from a port, a thread, a file or a process must enter here, too.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Sequence
from typing import TYPE_CHECKING, Protocol, TypeVar

from gateway.mount.motion.reconciler import Announce
from gateway.transport import ConnectionHandler
from gateway.transport.handler import Accept, Connected
from gateway.transport.wires import Transport

if TYPE_CHECKING:
    from gateway.core.requests import Request

_T = TypeVar("_T")
#: Work that a request asks for, begun when the request enters.
Work = Callable[[], Coroutine[object, object, _T]]


class Admitting(Protocol):
    """The acceptor of one surface's connections."""

    def accept(self, connected: Connected) -> ConnectionHandler: ...
    def admit(self, connected: Connected) -> None: ...
    def create(self, connected: Connected) -> ConnectionHandler: ...


class Entrance:
    """The entrance without a recording: everything enters as it arrives."""

    def accept(self, acceptor: Admitting) -> Accept:
        """Return the function that a port calls for each new connection."""
        return acceptor.accept

    def wire(self, wire: Transport) -> Transport:
        """Return the transport to the mount for the line to use."""
        return wire

    def announcers(self, announcers: Sequence[Announce]) -> Sequence[Announce]:
        """Return what the gateway awaits before a motion: functions that wait for something outside, as the disk."""
        return announcers

    async def begin(self, begin: Callable[[], None]) -> None:
        begin()

    def apply_event(self, arrow: str, act: Callable[[], None]) -> None:
        """Act on an outside event; ``arrow`` is its letter in a recording."""
        act()

    async def carry_out(self, arrow: str, work: Work[_T], request: Request | None = None) -> _T:
        """Carry out what was asked; ``arrow`` is its letter in a recording, which also holds a ``request``.

        Raises what the work raises.
        """
        return await work()
