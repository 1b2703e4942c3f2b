"""Surface: a client's commands in, operations out, replies back; without I/O.

``handle`` runs one command as a generator: it yields operations and is sent their answers, and its value is the reply.
The rows of ``surface.toml`` say what is done; those with ``call`` are functions of the protocol's own package. A
``FireAndForget`` is an operation whose outcome the client is never told: it is not waited for.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing, suppress
from functools import cache
from typing import NamedTuple

import msgspec

from gateway.core import operations
from gateway.core.errors import Disturbed, Fault, Invalid, NoTarget, Silence, Unsupported
from gateway.core.motion_kinds import begins_motion, may_begin_motion
from gateway.core.operations import AbortMotion, Operation, Own, PassThrough, Values
from gateway.protocols.base.frames import Suspect, Unterminated
from gateway.protocols.base.session import Session
from gateway.protocols.base.wants import FireAndForget, Handling, Subscription, Want, relayed
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import CommandSet
from gateway.protocols.wireformat.rows import Model, SurfaceRow

#: What some protocols answer whatever was done.
ACKNOWLEDGED = b"#"
#: What a row's ``call`` names: a function ``(session, command, values)`` -> the reply's values, or steps to them.
Special = Callable[..., object]


class Ending(NamedTuple):
    """What a command ends in the moment in which it comes, and the commands that do not get their turn any more."""

    operation: Operation
    takes_back: frozenset[bytes]


class Surface:
    def __init__(
        self,
        protocol: CommandSet,
        handlers: Mapping[str, Special],
        unanswered: Callable[[bytes, Fault | None], bytes] = lambda frame, fault: b"",
    ) -> None:
        #: ``unanswered`` gives the reply to a frame that nothing here answers, and to a fault that has no form.
        self.protocol, self.handlers, self.unanswered = protocol, handlers, unanswered
        #: What belongs to one client of this protocol.
        self.session: type[Session] = Session
        #: The mount speaks the same protocol: what means nothing here is passed on as it is, where it ``passes``.
        self.verbatim = False
        self.passes: Callable[[str, Values], bool] = lambda name, values: True
        #: Whether this client was told something that the mount's own answer would contradict.
        self.stands_against: Callable[..., bool] = lambda session, name, values: False
        #: A reply as the mount itself would write it, where it is the mount that is presented.
        self.as_written: Callable[[str, bytes], bytes] = lambda name, reply: reply
        #: What a client is told without asking, from the beginning of its connection on.
        self.subscriptions: Callable[[Session], Sequence[Subscription]] = lambda session: ()
        #: Whether a reply says no, where no row has a form for that.
        self.denies: Callable[[bytes], bool] = lambda reply: False
        #: Why what is presented does not know a frame, which is then passed over whatever it says; empty: it knows it.
        self.lacks: Callable[[Model, bytes], str] = lambda model, frame: ""

    def ending(self, session: Session, frame: bytes) -> Ending | None:
        """What a command ends when it comes, before it has its turn; None for all that wait for theirs."""
        command = self.protocol.ends_at_once.get(frame)
        if command is None:
            return None
        row = self.protocol.surface[command.name]
        return Ending(
            self._operation(session, row, {}) if command.urgent == "axis" else AbortMotion(),
            self.protocol.taken_back_by(command),
        )

    def handle(self, session: Session, frame: bytes) -> Handling:
        """One framed command -> its reply (empty: none). Yields operations; never raises for what a client sent."""
        if isinstance(frame, Unterminated):
            return (yield from self._refuse(session, frame))
        if isinstance(frame, Suspect):
            return (yield from relayed(self._handle(session, frame), _without_motion))
        return (yield from self._handle(session, frame))

    def _handle(self, session: Session, frame: bytes) -> Handling:
        if self.lacks(session.model, frame):
            return b""
        found = self.protocol.find(frame)
        if found is None:
            said = self.unanswered(frame, None)
            if said == ACKNOWLEDGED:
                session.refused = "its argument cannot be read"
            return said
        command, picture = found
        if command.name in session.model.get("lacking", ()):
            return b""
        row = self.protocol.surface.get(command.name)
        passed = self.verbatim and (row is None or row.handed_on)
        if row is None and not passed:
            return self.unanswered(frame, None)
        try:
            try:
                values = picture.decode(frame)
            except ValueError as error:
                if row is not None and row.call and not passed:
                    values = {"fault": Invalid(str(error))}
                else:
                    raise Invalid(str(error)) from None
            own = self.protocol.own.get(command.name) if session.model.get("own") else None
            if own is not None and own.keep is not None and "fault" not in values:
                with suppress(Unsupported):
                    return (yield from self._own(session, command, own.keep, values))
            if passed and not self.passes(command.name, values):
                return self.unanswered(frame, None)
            if row is None or passed:
                answer = yield from self._pass_on(session, command, row, values)
            else:
                answer = yield from self._act(session, command, row, values)
                if "fault" in values:  # it says the same whatever was done
                    session.refused = f"{command.help}: {values['fault']}"
            return self.reply(session, command, answer)
        except Fault as fault:
            said = _refusal(command, fault)
            if not said and isinstance(fault, Invalid):
                session.refused = f"{command.help}: {fault}"
            return said or self.unanswered(frame, fault)

    def _refuse(self, session: Session, frame: Unterminated) -> Handling:
        """Nothing of it is done, what it would have set is cleared, and the first command's no is said once."""
        yield from ()
        for name in frame.names:
            self._clear(session, name)
        command = self.protocol.commands.get(frame.names[0])
        return b"" if frame.late or command is None else _refusal(command, Invalid())

    def _clear(self, session: Session, name: str) -> None:
        """Have a command do to the session what it does when its value cannot be read."""
        row = self.protocol.surface.get(name)
        if row is None or row.call is None:
            return
        with suppress(Fault):
            steps = self.handlers[row.call](session, self.protocol.commands[name], {"fault": Invalid()})
            if isinstance(steps, Generator):
                with closing(steps):  # whatever it would ask of the mount is not asked
                    next(steps, None)

    def call(self, name: str, session: Session, command: Command | None, values: Values) -> Handling:
        """Carry out a special -> the reply's values."""
        outcome = self.handlers[name](session, command, values)
        return (yield from outcome) if isinstance(outcome, Generator) else outcome

    def _own(self, session: Session, command: Command, keep: str, values: Values) -> Handling:
        """The mount's own answer -> the reply. Raises Fault, Unsupported where the gateway answers after all."""
        if self.stands_against(session, command.name, values):
            raise Unsupported
        if keep == "library":
            answer = yield from self.call("own_library", session, command, values)
        elif keep == "order":
            answer = yield PassThrough(command.name, tuple(values.items()))
        else:
            try:
                answer = yield Own(command.name, tuple(values.items()), keep)
            except Silence:
                answer = b""
        return self.reply(session, command, answer)

    def _pass_on(self, session: Session, command: Command, row: SurfaceRow | None, values: Values) -> Handling:
        """To a mount of the same protocol; one that lacks it leaves it to this surface."""
        try:
            return (yield PassThrough(command.name, tuple(values.items())))
        except Unsupported:
            if row is None or not row.passes:
                raise
        return (yield from self._act(session, command, row, values))

    def silence(self, session: Session, frame: bytes) -> str:
        """Why a command has no reply, where its sender may have expected one; empty where none is due."""
        if isinstance(frame, Unterminated):
            return ""  # that was said when it came
        if lacking := self.lacks(session.model, frame):
            return lacking
        found = self.protocol.find(frame)
        if found is None:
            return f"{self.protocol.name} has no such command"
        if found[0].name in session.model.get("lacking", ()):
            return f"{found[0].help}: this mount has no such command; a surface that names a model has it"
        row = self.protocol.surface.get(found[0].name)
        if row is None:
            return f"{found[0].help}: not answered here"
        if isinstance(frame, Suspect) and may_begin_motion(row.operations):
            return f"{found[0].help}: not done. {Disturbed.words}"
        return f"{found[0].help}: {row.why or 'not done here'}" if row.outcome == "refused" else ""

    def _act(self, session: Session, command: Command, row: SurfaceRow, values: Values) -> Handling:
        """Carry out a row's verb -> the reply's values."""
        if row.keep is not None:
            for name in row.keep:
                setattr(session.kept, name, values[name])
            return None
        if row.tell is not None:
            return {name: session.known(name) for name in row.tell}
        if row.say is not None:
            return row.say
        if row.ask is not None:
            operation = self._operation(session, row, values)
            if not command.replies:
                yield FireAndForget(operation)
                return None
            return (yield operation)
        assert row.call is not None
        return (yield from self.call(row.call, session, command, values))

    def _operation(self, session: Session, row: SurfaceRow, values: Values) -> Operation:
        """The operation that a row asks, with its fields from the command or the row, else from what was set before."""
        kind = operations.named(row.ask or "")
        assert kind is not None
        fields: Values = {}
        for field, required in _needs(kind):
            value = values.get(field, row.given.get(field, getattr(session.kept, field, None)))
            if value is None and required:
                raise NoTarget
            if value is not None:
                fields[field] = value
        return kind(**fields)

    def reply(self, session: Session, command: Command, answer: object) -> bytes:
        """The first reply form that is no refusal and suits the client's format, filled in."""
        if isinstance(answer, bytes):
            return answer
        for reply, picture in command.replies:
            if reply.fault is None and reply.when in (None, session.kept.precision, session.model.get("name")):
                return self.as_written(command.name, picture.encode(_fields_of(answer, picture.fields)))
        return b""


def _without_motion(wanted: Want) -> bool:
    """Whether something is not done because it would set something moving. Raises Disturbed where that can be said."""
    if not begins_motion(getattr(wanted, "operation", wanted)):
        return False
    if isinstance(wanted, FireAndForget):
        return True
    raise Disturbed


def _refusal(command: Command, fault: Fault) -> bytes:
    """The reply form that stands for this fault, else the first that stands for any, else silence."""
    refusals = [(reply, picture) for reply, picture in command.replies if reply.fault is not None]
    name = type(fault).__name__
    chosen = next((item for item in refusals if item[0].fault == name), refusals[0] if refusals else None)
    if chosen is None:
        return b""
    return chosen[1].encode(dict.fromkeys(chosen[1].fields, str(fault)))


@cache
def _needs(kind: type[Operation]) -> tuple[tuple[str, bool], ...]:
    """The fields of an operation, and whether each must be given; looking them up costs more than all of a reply."""
    return tuple((field.name, field.required) for field in msgspec.structs.fields(kind))


def _fields_of(answer: object, names: Mapping[str, object]) -> Mapping[str, object]:
    """An answer as the fields a reply wants: a mapping, a struct, or one bare value for one field."""
    if isinstance(answer, Mapping):
        return answer
    if isinstance(answer, msgspec.Struct):
        return msgspec.structs.asdict(answer)
    return dict.fromkeys(names, answer)
