"""Converts an HTTP request to a line of text, which the surface handles; reads its ClientID and ClientTransactionID.

ASCOM defines that the path is in lower case. A GET has its parameters in the query, with names in any case; a PUT has
them in its body, with names in exact case. A missing or invalid parameter is an error (400); unknown parameters are
ignored. A line of text ends with a line feed; ``LineFramer`` drops a line that is too long or has no end.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from typing import NamedTuple

from gateway.protocols.base.frames import WholeCommandFramer
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.numerals import quote_text

#: The greatest ClientID and ClientTransactionID.
MAX_ID = 2**32 - 1
#: Bytes of the longest line that is accepted.
MAX_LINE_BYTES = 4096
#: Why the bytes of a long line are dropped, for the log.
TOO_LONG_REASON = "longer than any request"
_PARAMETER = re.compile(r" (\w+)=\{(\w+):")
_PLAIN_NUMBER = re.compile(r"[0-9]{1,10}")
#: Names and values of parameters.
ParameterPairs = Sequence[tuple[str, str]]


class BadRequest(Exception):
    """The request is invalid. ``allowed_methods``: the methods of this member if the request used another method."""

    def __init__(self, text: str, allowed_methods: str = "") -> None:
        super().__init__(text)
        self.allowed_methods = allowed_methods


class AlpacaRequest(NamedTuple):
    """A request for a member: its line and command, ClientID and ClientTransactionID (0 if they are missing)."""

    line: bytes
    command: Command
    client_id: int
    transaction_id: int


class Signature(NamedTuple):
    """The command of a member and method, and the names of its parameters in order."""

    command: Command
    parameters: tuple[str, ...]


@cache
def signatures() -> Mapping[tuple[str, str], Signature]:
    """Return (method in lower case, member) -> signature."""
    table = {}
    for command in load("alpaca").commands.values():
        source = str(command.request.source)
        verb, member = source.split()[:2]
        table[verb, member] = Signature(command, tuple(name for name, _ in _PARAMETER.findall(source)))
    return table


def parse_request(method: str, member: str, pairs: ParameterPairs) -> AlpacaRequest:
    """Return the request for a member. Raises BadRequest for an unknown member, or a missing or invalid parameter."""
    verb = method.lower()
    match = signatures().get((verb, member))
    if match is None:
        others = [known for known in ("get", "put") if (known, member) in signatures()]
        if others:
            raise BadRequest(f"{member} has no {method}", allowed_methods=", ".join(others).upper())
        raise BadRequest(f"A telescope has no member {member!r}")
    given = _Parameters(pairs, any_case=verb == "get")
    fields = [f"{name}={quote_text(given.value(name)).decode('ascii')}" for name in match.parameters]
    line = " ".join([verb, member, *fields]).encode("ascii") + b"\n"
    try:
        match.command.request.decode(line)
    except (ValueError, OverflowError) as error:
        raise BadRequest(f"{member}: {error}") from None
    return AlpacaRequest(line, match.command, *parse_request_ids(pairs, any_case=verb == "get"))


def parse_request_ids(pairs: ParameterPairs, *, any_case: bool) -> tuple[int, int]:
    """Return ClientID and ClientTransactionID. Raises BadRequest if either is not a valid number."""
    given = _Parameters(pairs, any_case)
    return given.number("ClientID"), given.number("ClientTransactionID")


class _Parameters:
    def __init__(self, pairs: ParameterPairs, any_case: bool) -> None:
        self._fold_case = str.lower if any_case else str
        self._values: dict[str, str] = {}
        for name, value in pairs:
            self._values.setdefault(self._fold_case(name), value)

    def value(self, name: str) -> str:
        try:
            return self._values[self._fold_case(name)]
        except KeyError:
            raise BadRequest(f"The parameter {name} is missing") from None

    def number(self, name: str) -> int:
        text = self._values.get(self._fold_case(name), "0")
        if not _PLAIN_NUMBER.fullmatch(text) or int(text) > MAX_ID:
            raise BadRequest(f"{name} is {text!r}; it must be a whole number from 0 to {MAX_ID}")
        return int(text)


# --- lines ------------------------------------------------------------------------------------------------------------


class LineFramer(WholeCommandFramer):
    """Cuts a stream into lines, each an HTTP request in the text form of the surface; drops what has no end."""

    cut_off_reason = "half a request, whose end did not arrive"

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """Return the lines that these bytes complete, in order."""
        self.dropped.clear()
        *whole, rest = (bytes(self._pending) + data).split(b"\n")
        frames = [line + b"\n" for line in whole]
        if self._dropping and frames:
            self.dropped.add(frames.pop(0), TOO_LONG_REASON)
            self._dropping = False
        if len(rest) > MAX_LINE_BYTES:
            self.dropped.add(rest, TOO_LONG_REASON)
            rest, self._dropping = b"", True
        self._pending = bytearray(rest)
        return frames
