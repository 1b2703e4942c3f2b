"""Frame templates: frames made of fields, as the manuals draw them.

A template is a string (``":Sr{ra:HH:MM:SS}#"``) or a list of bytes, characters and fields
(``["P", 2, 17, 36, "{rate:u8}", 0, 0, 0]``). It turns named values into bytes and bytes into named values,
and knows nothing of what they mean. Regular expressions are made when first needed: start-up has no time for them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cached_property

from gateway.core.operations import Values
from gateway.protocols.wireformat.fields import Codec, codec

Source = str | list[str | int]


class FrameTemplate:
    """One frame form. ``fields`` maps field names to codecs in wire order; ``literal`` is what comes before them."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.parts: list[bytes | tuple[str, Codec]] = []
        for piece in [source] if isinstance(source, str) else source:
            self._add(piece)
        self.fields: dict[str, Codec] = {part[0]: part[1] for part in self.parts if isinstance(part, tuple)}
        self.literal = self.parts[0] if self.parts and isinstance(self.parts[0], bytes) else b""
        widths = [len(part) if isinstance(part, bytes) else part[1].width for part in self.parts]
        self.width = None if None in widths else sum(width for width in widths if width is not None)

    def _add(self, piece: str | int) -> None:
        """Split one piece into literals and fields. Raises ValueError for a field that no codec knows."""
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
        """The whole frame as a regular expression, one group per field."""
        pattern = b"".join(
            re.escape(part) if isinstance(part, bytes) else b"(" + part[1].pattern + b")" for part in self.parts
        )
        return re.compile(pattern, re.DOTALL)

    def encode(self, values: Mapping[str, object]) -> bytes:
        """Values -> bytes. Raises KeyError for a missing field, ValueError for one that does not fit."""
        return b"".join([part if isinstance(part, bytes) else part[1].encode(values[part[0]]) for part in self.parts])

    def decode(self, frame: bytes) -> Values:
        """Bytes -> values. Raises ValueError when the frame is of another form or a field is out of range."""
        found = self.matcher.fullmatch(frame)
        if found is None:
            raise ValueError(f"{frame!r} is not {self.source!r}")
        return {name: field.decode(raw) for (name, field), raw in zip(self.fields.items(), found.groups(), strict=True)}

    def __repr__(self) -> str:
        return f"FrameTemplate({self.source!r})"
