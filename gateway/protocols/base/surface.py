"""Surface: turns a client's commands into operations and their answers into replies, without I/O.

``handle`` runs a command as a generator: it yields operations, is sent their answers, and returns the reply. The rows
of ``surface.toml`` define what a command does; rows with ``call`` name functions of the protocol's own package.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing, suppress
from functools import cache
from typing import NamedTuple

import msgspec

from gateway.core import operations
from gateway.core.errors import Disturbed, Fault, Invalid, NoTarget, Silence, Unsupported
from gateway.core.motion_kinds import GOTOS, begins_motion, may_begin_motion
from gateway.core.operations import AbortMotion, NativeRequest, Operation, PassThrough, Values
from gateway.protocols.base.frames import Suspect, Unterminated
from gateway.protocols.base.session import Session
from gateway.protocols.base.wants import FireAndForget, Handling, Subscription, SurfaceStep, relay_requests
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import CommandSet
from gateway.protocols.wireformat.rows import Model, SurfaceRow

#: The reply that some protocols give whether or not the command was carried out.
ACKNOWLEDGED = b"#"
#: A function that a row's ``call`` names, (session, command, values) -> the reply's values, or a generator of them.
Handler = Callable[..., object]


class UrgentEnd(NamedTuple):
    """What an urgent command does on arrival: the operation that ends a motion, and the queued frames it discards."""

    operation: Operation
    discarded: frozenset[bytes]


class Surface:
    """A protocol as its programs see it. The state of a client is in its session, which every method receives."""

    def __init__(
        self,
        protocol: CommandSet,
        handlers: Mapping[str, Handler],
        fallback_reply: Callable[[bytes, Fault | None], bytes] = lambda frame, fault: b"",
    ) -> None:
        #: ``fallback_reply`` returns the reply to a frame that no row answers, and to a fault without a reply form.
        self.protocol, self.handlers, self.fallback_reply = protocol, handlers, fallback_reply
        #: The session class of this protocol.
        self.session_type: type[Session] = Session
        #: Whether the mount speaks the same protocol: commands that the surface does not handle are passed on to it.
        self.speaks_mount_protocol = False
        #: (command name, values) -> whether the command may be passed on.
        self.may_pass_on: Callable[[str, Values], bool] = lambda name, values: True
        #: (session, command name, values) -> whether the mount's reply would contradict an earlier one to this client.
        self.contradicts_client: Callable[..., bool] = lambda session, name, values: False
        #: (command name, reply) -> the reply in the mount's notation, if the surface presents the mount itself.
        self.to_mount_form: Callable[[str, bytes], bytes] = lambda name, reply: reply
        #: Session -> the data that the client is sent without requests, from the beginning of its connection on.
        self.subscriptions: Callable[[Session], Sequence[Subscription]] = lambda session: ()
        #: Whether a reply is a refusal, in protocols whose rows have no reply form for a refusal.
        self.is_refusal: Callable[[bytes], bool] = lambda reply: False
        #: Whether clients wait for replies to commands; if not, a motion may begin long after its command.
        self.has_replies = True
        #: (model, frame) -> why the presented model lacks a command, which is then ignored; empty if it has it.
        self.lacking_reason: Callable[[Model, bytes], str] = lambda model, frame: ""

    def urgent_end(self, session: Session, frame: bytes) -> UrgentEnd | None:
        """Return what an urgent command ends at once, ahead of queued commands; None if the command is not urgent."""
        command = self.protocol.immediate_commands.get(frame)
        if command is None:
            return None
        row = self.protocol.surface_rows[command.name]
        return UrgentEnd(
            self._operation_of_row(session, row, {}) if command.urgent == "axis" else AbortMotion(),
            self.protocol.discarded_prefixes(command),
        )

    def begins_goto(self, frame: bytes) -> bool:
        """Whether a command may begin a goto."""
        match = self.protocol.find(frame)
        row = self.protocol.surface_rows.get(match[0].name) if match is not None else None
        return row is not None and any(
            issubclass(operations.operation_class(name) or Operation, GOTOS) for name in row.operations
        )

    def handle(self, session: Session, frame: bytes) -> Handling:
        """Handle a frame: yield operations, return the reply (empty: none). No input of a client makes it raise."""
        if isinstance(frame, Unterminated):
            return (yield from self._refuse_unterminated(session, frame))
        if isinstance(frame, Suspect):
            return (yield from relay_requests(self._handle(session, frame), _drops_motion))
        return (yield from self._handle(session, frame))

    def _handle(self, session: Session, frame: bytes) -> Handling:
        if self.lacking_reason(session.model, frame):
            return b""
        match = self.protocol.find(frame)
        if match is None:
            reply = self.fallback_reply(frame, None)
            if reply == ACKNOWLEDGED:
                session.refusal_reason = "its argument is not valid"
            return reply
        command, template = match
        if command.name in session.model.get("lacking", ()):
            return self.fallback_reply(frame, None)
        row = self.protocol.surface_rows.get(command.name)
        passed = self.speaks_mount_protocol and (row is None or row.is_passed_on)
        if row is None and not passed:
            return self.fallback_reply(frame, None)
        try:
            try:
                values = template.decode(frame)
            except ValueError as error:
                if row is not None and row.call and not passed:
                    values = {"fault": Invalid(str(error))}
                else:
                    raise Invalid(str(error)) from None
            native = self.protocol.own_rows.get(command.name) if session.model.get("own") else None
            if native is not None and native.keep is not None and "fault" not in values:
                with suppress(Unsupported):
                    return (yield from self._native_reply(session, command, native.keep, values))
            if passed and not self.may_pass_on(command.name, values):
                return self.fallback_reply(frame, None)
            if row is None or passed:
                answer = yield from self._pass_on(session, command, row, values)
            else:
                answer = yield from self._carry_out(session, command, row, values)
                if "fault" in values:  # the handler replied as if nothing were wrong
                    session.refusal_reason = f"{command.help}: {values['fault']}"
            return self.reply(session, command, answer)
        except Fault as fault:
            refusal = _refusal(command, fault)
            session.must_log_refusal = bool(refusal) and not fault.is_logged and not command.is_query
            if not refusal and isinstance(fault, Invalid):
                session.refusal_reason = f"{command.help}: {fault}"
            return refusal or self.fallback_reply(frame, fault)

    def _refuse_unterminated(self, session: Session, frame: Unterminated) -> Handling:
        """Refuse an unterminated frame: clear the values that it would have set; return a refusal unless it is late."""
        yield from ()
        for name in frame.command_names:
            self._clear_value(session, name)
        command = self.protocol.commands.get(frame.command_names[0])
        return b"" if frame.late or command is None else _refusal(command, Invalid())

    def _clear_value(self, session: Session, command_name: str) -> None:
        """Clear the value that a command would have set: run its handler as for a value that cannot be decoded."""
        row = self.protocol.surface_rows.get(command_name)
        if row is None or row.call is None:
            return
        steps = self.call(row.call, session, self.protocol.commands[command_name], {"fault": Invalid()})
        with suppress(Fault, StopIteration), closing(steps):  # it must not request anything of the mount
            next(steps)

    def call(self, handler: str, session: Session, command: Command | None, values: Values) -> Handling:
        """Run the handler of a row with ``call``; return the reply's values."""
        outcome = self.handlers[handler](session, command, values)
        return (yield from outcome) if isinstance(outcome, Generator) else outcome

    def _native_reply(self, session: Session, command: Command, reuse: str, values: Values) -> Handling:
        """Return the mount's reply; ``reuse``: a ReplyReuse. Raises Fault: Unsupported if the gateway must answer."""
        if self.contradicts_client(session, command.name, values):
            raise Unsupported
        if reuse == "library":
            answer = yield from self.call("objects.use_mount_library", session, command, values)
        elif reuse == "order":
            answer = yield PassThrough(command.name, tuple(values.items()))
        else:
            try:
                answer = yield NativeRequest(command.name, tuple(values.items()), reuse)
            except Silence:
                answer = b""
        return self.reply(session, command, answer)

    def _pass_on(self, session: Session, command: Command, row: SurfaceRow | None, values: Values) -> Handling:
        """Pass a command to a mount of the same protocol; if the mount lacks it, carry out a row with ``passes``."""
        try:
            return (yield PassThrough(command.name, tuple(values.items())))
        except Unsupported:
            if row is None or not row.passes:
                raise
        return (yield from self._carry_out(session, command, row, values))

    def silence_reason(self, session: Session, frame: bytes) -> str:
        """Return why a command has no reply although its client may expect one; empty if the client expects none."""
        if isinstance(frame, Unterminated):
            return ""  # the log said so when it arrived
        if lacking := self.lacking_reason(session.model, frame):
            return lacking
        match = self.protocol.find(frame)
        if match is None:
            return f"{self.protocol.name} has no such command"
        if match[0].name in session.model.get("lacking", ()):
            return f"{match[0].help}: this mount has no such command; a surface that names a model has it"
        row = self.protocol.surface_rows.get(match[0].name)
        if row is None:
            return f"{match[0].help}: not answered here"
        if isinstance(frame, Suspect) and may_begin_motion(row.operations):
            return f"{match[0].help}: not done. {Disturbed.default_text}"
        return f"{match[0].help}: {row.why or 'not done here'}" if row.outcome == "refused" else ""

    def _carry_out(self, session: Session, command: Command, row: SurfaceRow, values: Values) -> Handling:
        """Carry out a row (its ask, tell, say or call); return the reply's values."""
        if row.tell is not None:
            return {name: session.setting_or_constant(name) for name in row.tell}
        if row.say is not None:
            return row.say
        if row.ask is not None:
            operation = self._operation_of_row(session, row, values)
            if not command.replies:
                yield FireAndForget(operation)
                return None
            return (yield operation)
        assert row.call is not None
        return (yield from self.call(row.call, session, command, values))

    def _operation_of_row(self, session: Session, row: SurfaceRow, values: Values) -> Operation:
        """Return the operation of a row with ``ask``, its fields from the command, the row or the client's settings.
        Raises NoTarget if a required field is missing.
        """
        kind, needs = _operation_fields(row.ask or "")
        fields: Values = {}
        for field, required in needs:
            value = values.get(field, row.given.get(field, getattr(session.client, field, None)))
            if value is None and required:
                raise NoTarget
            if value is not None:
                fields[field] = value
        return kind(**fields)

    def reply(self, session: Session, command: Command, answer: object) -> bytes:
        """Encode the answer in the first form for the client's format; return b"" without one, and bytes unchanged."""
        if isinstance(answer, bytes):
            return answer
        model = session.model
        form = command.reply_form(session.client.precision, model.get("name"), model.get("dialect"))
        if form is None:
            return b""
        return self.to_mount_form(command.name, form.encode(_reply_fields(answer, form.fields)))


def _drops_motion(request: SurfaceStep) -> bool:
    """Whether a request begins a motion and may be dropped silently. Raises Disturbed if its client awaits a reply."""
    if not begins_motion(getattr(request, "operation", request)):
        return False
    if isinstance(request, FireAndForget):
        return True
    raise Disturbed


def _refusal(command: Command, fault: Fault) -> bytes:
    """Return the reply form for this fault or its base class, else the first form for any fault, else nothing."""
    refusals = [(reply, template) for reply, template in command.replies if reply.fault is not None]
    names = [kind.__name__ for kind in type(fault).__mro__]
    exact = (item for name in names for item in refusals if item[0].fault == name)
    chosen = next(exact, refusals[0] if refusals else None)
    if chosen is None:
        return b""
    return chosen[1].encode(dict.fromkeys(chosen[1].fields, fault.brief or str(fault)))


@cache
def _operation_fields(name: str) -> tuple[type[Operation], tuple[tuple[str, bool], ...]]:
    """Return the class of an operation, and its fields as pairs of name and whether it is required."""
    kind = operations.operation_class(name)
    assert kind is not None
    return kind, tuple((field.name, field.required) for field in msgspec.structs.fields(kind))


def _reply_fields(answer: object, names: Mapping[str, object]) -> Mapping[str, object]:
    """Return the answer as the fields of a reply: from a mapping, a struct, or a value for a single field."""
    if isinstance(answer, Mapping):
        return answer
    if isinstance(answer, msgspec.Struct):
        return msgspec.structs.asdict(answer)
    return dict.fromkeys(names, answer)
