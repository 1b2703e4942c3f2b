"""A command of the tables, ready for use: templates of its requests and replies, and the models that have it.

A template is written like a frame in the manuals: a string (``":Sr{ra:HH:MM:SS}#"``) or a list of bytes, characters and
fields (``["P", 2, 17, 36, "{rate:u8}", 0, 0, 0]``). It converts between bytes and named values, whatever the values
mean. An invalid template raises MappingError with file, row and reason.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cached_property

from gateway.core.errors import MappingError
from gateway.core.operations import Values
from gateway.core.wire_log import printable
from gateway.protocols.wireformat.fields import Codec, codec
from gateway.protocols.wireformat.rows import CommandRow, FrameSource, ReplyForm, Version, parse_version


class FrameTemplate:
    """The template of a frame. ``fields``: name -> codec, in wire order; ``prefix``: the bytes before the first field;
    ``length``: the length of the frame in bytes, None if that varies. Raises ValueError for an invalid template.
    """

    def __init__(self, source: FrameSource) -> None:
        self.source = source
        self.parts: list[bytes | tuple[str, Codec]] = []
        for piece in [source] if isinstance(source, str) else source:
            self._add_piece(piece)
        self.fields: dict[str, Codec] = {part[0]: part[1] for part in self.parts if isinstance(part, tuple)}
        self.prefix = self.parts[0] if self.parts and isinstance(self.parts[0], bytes) else b""
        widths = [len(part) if isinstance(part, bytes) else part[1].length for part in self.parts]
        self.length = None if None in widths else sum(width for width in widths if width is not None)

    def _add_piece(self, piece: str | int) -> None:
        """Add an element of the source, split into literals and fields. Raises ValueError for an invalid field."""
        if isinstance(piece, int):
            self._add_literal(bytes((piece,)))
            return
        while piece:
            before, brace, rest = piece.partition("{")
            self._add_literal(before.encode("latin-1"))
            if not brace:
                return
            inside, closing, piece = rest.partition("}")
            name, colon, form = inside.partition(":")
            if not closing or not colon or not name.isidentifier():
                raise ValueError(f"field {{{inside}}} is not written {{name:form}}")
            try:
                self.parts.append((name, codec(form)))
            except KeyError:
                raise ValueError(f"field form {form!r} is unknown") from None

    def _add_literal(self, literal: bytes) -> None:
        if literal and self.parts and isinstance(self.parts[-1], bytes):
            self.parts[-1] += literal
        elif literal:
            self.parts.append(literal)

    @cached_property
    def matcher(self) -> re.Pattern[bytes]:
        """A regular expression for the frame, with a group for each field; compiled when it is first used."""
        pattern = b"".join(
            re.escape(part) if isinstance(part, bytes) else b"(" + part[1].pattern + b")" for part in self.parts
        )
        return re.compile(pattern, re.DOTALL)

    def encode(self, values: Mapping[str, object]) -> bytes:
        """Return the frame. Raises KeyError for a missing field, ValueError for a value that does not fit."""
        return b"".join([part if isinstance(part, bytes) else part[1].encode(values[part[0]]) for part in self.parts])

    def decode(self, frame: bytes) -> Values:
        """Return the values in a frame. Raises ValueError if it has another form or a field is out of range."""
        match = self.matcher.fullmatch(frame)
        if match is None:
            raise ValueError(f"'{printable(frame)}' is not {self.source!r}")
        return {name: field.decode(raw) for (name, field), raw in zip(self.fields.items(), match.groups(), strict=True)}


class Command:
    """A row of ``commands.toml`` with its templates. ``CommandRow`` explains the attributes, some under other names.
    ``file_name``: the file's name in a MappingError. ``replies`` pairs each reply form with its template.
    """

    def __init__(self, file_name: str, name: str, row: CommandRow) -> None:
        self.name, self.help, self.beyond, self.has_effect = name, row.help, row.beyond, row.acts
        self.models = frozenset(row.models) if row.models is not None else None
        #: The models whose row in ``models.toml`` lists commands without this command.
        self.lacking_models: frozenset[str] = frozenset()
        self.answer_kind, self.discarded_commands = row.answer, row.takes_back
        self.urgent, self.urgent_values = row.urgent, row.urgent_at
        self.long, self.by_hand, self.may_be_silent = row.long, row.by_hand, row.may_be_silent
        self.allowed_while_homing, self.allowed_while_asleep = row.while_seeking, row.while_asleep
        self.pushed, self.read = row.pushed, row.read
        try:
            self.first_version = parse_version(row.since) if row.since else None
            self.requests = [FrameTemplate(source) for source in _request_forms(row.request)]
            self.replies = [(reply, FrameTemplate(reply.wire)) for reply in _reply_forms(row.reply)]
        except ValueError as error:
            raise MappingError(file_name, name, str(error)) from None
        self.request = self.requests[0]

    @property
    def is_query(self) -> bool:
        """Whether the command reads a value and does nothing else."""
        return not self.has_effect and any(reply.fault is None and template.fields for reply, template in self.replies)

    @property
    def requested(self) -> bool:
        """Whether programs send this command; if not, the gateway sends the message unasked."""
        return bool(self.request.parts)

    @property
    def urgent_mark(self) -> bytes:
        """The bytes by which an urgent command is recognised in a byte stream before it is cut into frames."""
        if not self.urgent_values:
            return self.request.prefix.removesuffix(b"#")
        end = self.request.parts[-1]
        return self.request.encode(self.urgent_values).removesuffix(end if isinstance(end, bytes) else b"")

    def reply_form(self, *formats: object) -> FrameTemplate | None:
        """Return the template of the first reply, no error, that fits the formats (``ReplyForm.when``), or None."""
        fitting = (form for reply, form in self.replies if reply.fault is None and reply.when in (None, *formats))
        return next(fitting, None)

    def exists_on(self, model: str | None, version: Version | None) -> bool:
        """Whether this model and version have the command according to the manual; true if they are unknown (None)."""
        if model in self.lacking_models or (self.models is not None and model is not None and model not in self.models):
            return False
        return self.first_version is None or version is None or version >= self.first_version


def _request_forms(request: str | list[str | int]) -> list[FrameSource]:
    """Return the alternative forms of a request: a list of characters, numbers and fields is a single form, a list of
    longer strings has a form in each string.
    """
    if isinstance(request, str):
        return [request]
    if all(isinstance(piece, int) or len(piece) == 1 or piece.startswith("{") for piece in request):
        return [request]
    return [str(piece) for piece in request]


def _reply_forms(reply: str | list[str | int | ReplyForm] | None) -> list[ReplyForm]:
    if reply is None:
        return []
    variants = [item for item in reply if isinstance(item, ReplyForm)]
    if isinstance(reply, str) or not variants:
        return [ReplyForm(wire=reply)]  # type: ignore[arg-type]
    return variants
