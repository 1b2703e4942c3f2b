"""A player that also notes what a surface asks the mount for, and what it keeps and reads for its clients."""

from __future__ import annotations

from typing import Any, NamedTuple

from gateway.core.motion_kinds import END_ORDERS
from gateway.core.operations import Operation, Read, operation_class
from gateway.diagnostics.rehearsal.play import SETTING_OBSERVATION_TIME, Prelude, Trace, Tracer, may_change_mount
from gateway.diagnostics.rehearsal.stage import RehearsalGateway
from gateway.protocols.base.session import Session
from gateway.protocols.base.wants import CheckPossible, Handling, SurfaceStep, relay_requests
from gateway.protocols.registry import drivers
from gateway.protocols.wireformat.command_set import load


class Seen(NamedTuple):
    """A play, and what was seen of it inside the gateway: the operations that were ``asked`` for, each once; whether
    something ``kept`` for clients has changed, and what the driver knows (``learnt``); whether the reply was made of
    what is kept (``tells``).
    """

    play: Trace
    asked: tuple[str, ...] = ()
    kept: bool = False
    learnt: bool = False
    tells: bool = False

    @property
    def deciding(self) -> list[str]:
        """The operations that decide what becomes of a command: those that change the mount, else the reads of it."""
        can = {name for mount in drivers() for name in load(mount).driver_rows}
        return [name for name in self.asked if may_change_mount(name)] or [name for name in self.asked if name in can]


class Watcher(Tracer):
    def __init__(self, stage: RehearsalGateway) -> None:
        super().__init__(stage)
        self._session: Session | None = None
        self._before = self._known = ""
        self._asked: dict[str, None] = {}
        self._calling = self._tells = False
        surface, self._call = self.surface, self.surface.call
        handle, ending, perform = surface.handle, surface.urgent_end, self.driver.perform
        surface.session_type = self._noting(surface.session_type)
        surface.handle = lambda session, frame: handle(self._begun(session), frame)
        surface.call = self._called
        surface.urgent_end = lambda session, frame: self._ended(ending(session, frame))
        self.driver.perform = lambda operation: perform(self._performed(operation))

    async def watch(
        self, frame: bytes, before: Prelude = Prelude(), watching: float = SETTING_OBSERVATION_TIME
    ) -> Seen:
        play = await self.trace(frame, before, watching)
        return Seen(play, tuple(self._asked), self._before != self._kept(), self._known != self._knows(), self._tells)

    def before_frame(self) -> None:
        self._session, self._before, self._known, self._tells = None, "", self._knows(), False
        self._asked.clear()

    def _kept(self) -> str:
        """Return what is kept for this client and for all clients, as comparable text."""
        return "" if self._session is None else repr((self._session.client, self._session.shared))

    def _knows(self) -> str:
        """Return what the driver and the site clock know, as comparable text."""
        return repr((vars(self.driver), vars(self.rehearsal.site_clock)))

    def _begun(self, session: Session) -> Session:
        if self._session is None:
            self._session, self._before = session, ""
            self._before = self._kept()
        return session

    def _noting(self, kind: Any) -> type[Session]:
        """Return the class of a session that notes when the function of a row reads what is kept."""
        watcher = self

        class Noting(kind):
            def __getattribute__(self, name: str) -> object:
                watcher._tells |= watcher._calling and name in ("client", "shared_settings")
                return super().__getattribute__(name)

        return Noting

    def _called(self, *given: Any) -> Handling:
        self._calling = True
        try:
            return (yield from relay_requests(self._call(*given), self._requested))
        finally:
            self._calling = False

    def _requested(self, wanted: SurfaceStep) -> bool:
        """Note the operation of a request; return False, as it is carried out as well."""
        operation = getattr(wanted, "operation", wanted)
        if isinstance(operation, Operation) and not isinstance(wanted, CheckPossible):
            self._asked[type(operation).__name__] = None
        return False

    def _ended(self, ending: Any) -> Any:
        """Note the operation of a command that ends something on its arrival."""
        if ending is not None:
            self._asked[type(ending.operation).__name__] = None
        return ending

    def _performed(self, operation: Operation) -> Operation:
        """Note an operation that changes the mount, also one made of another one; not the end of a pulse."""
        name = type(operation).__name__
        if not isinstance(operation, (Read, *END_ORDERS)) and operation_class(name) is not None:
            self._asked[name] = None
        return operation
