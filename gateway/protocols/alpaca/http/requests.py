"""A request as HTTP has it -> one line for the surface, and the numbers by which program and request are known.

As ASCOM has it: the address is in lower case; a GET has its parameters in the address, in any case; a PUT has them in
its body, in exactly this case. What lacks a parameter, or has one that is no such value, is not understood (400).
Parameters that nobody knows are passed over. A line ends with a line feed; what is longer than any request is dropped
up to its end, and so is a line that is not finished.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from typing import NamedTuple

from gateway.protocols.base.frames import WholeFramer
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.numerals import quoted

#: The largest number of a program, and of a request.
MOST = 2**32 - 1
#: Bytes of the longest line.
LONGEST = 4096
#: Why bytes are of no use.
TOO_LONG = "no request is as long as this"
_PARAMETER = re.compile(r" (\w+)=\{(\w+):")
_PLAIN_NUMBER = re.compile(r"[0-9]{1,10}")
Pairs = Sequence[tuple[str, str]]


class BadRequest(Exception):
    """It cannot be understood; ``allow`` names the methods that there are where another one was used."""

    def __init__(self, words: str, allow: str = "") -> None:
        super().__init__(words)
        self.allow = allow


class Asked(NamedTuple):
    """A request for a member: its line, its command, and who asks by which numbers, 0 where they were not told."""

    line: bytes
    command: Command
    client: int
    transaction: int


class Signature(NamedTuple):
    """A member with one method: its command, and the names of its parameters in their order."""

    command: Command
    parameters: tuple[str, ...]


@cache
def signatures() -> Mapping[tuple[str, str], Signature]:
    """(method in lower case, member) -> signature."""
    found = {}
    for command in load("alpaca").commands.values():
        source = str(command.request.source)
        verb, member = source.split()[:2]
        found[verb, member] = Signature(command, tuple(name for name, _ in _PARAMETER.findall(source)))
    return found


def understood(method: str, member: str, pairs: Pairs) -> Asked:
    """``pairs`` are the parameters where this method has them. Raises BadRequest."""
    verb = method.lower()
    found = signatures().get((verb, member))
    if found is None:
        others = [known for known in ("get", "put") if (known, member) in signatures()]
        if others:
            raise BadRequest(f"{member} has no {method}", allow=", ".join(others).upper())
        raise BadRequest(f"A telescope has no member {member!r}")
    given = _Given(pairs, any_case=verb == "get")
    words = [f"{name}={quoted(given.value(name)).decode('ascii')}" for name in found.parameters]
    line = " ".join([verb, member, *words]).encode("ascii") + b"\n"
    try:
        found.command.request.decode(line)
    except (ValueError, OverflowError) as error:
        raise BadRequest(f"{member}: {error}") from None
    return Asked(line, found.command, *who_asks(pairs, any_case=verb == "get"))


def who_asks(pairs: Pairs, *, any_case: bool) -> tuple[int, int]:
    """ClientID and ClientTransactionID. Raises BadRequest for what is no such number."""
    given = _Given(pairs, any_case)
    return given.number("ClientID"), given.number("ClientTransactionID")


class _Given:
    def __init__(self, pairs: Pairs, any_case: bool) -> None:
        self._fold = str.lower if any_case else str
        self._values: dict[str, str] = {}
        for name, value in pairs:
            self._values.setdefault(self._fold(name), value)

    def value(self, name: str) -> str:
        try:
            return self._values[self._fold(name)]
        except KeyError:
            raise BadRequest(f"The parameter {name} is missing") from None

    def number(self, name: str) -> int:
        text = self._values.get(self._fold(name), "0")
        if not _PLAIN_NUMBER.fullmatch(text) or int(text) > MOST:
            raise BadRequest(f"{name} is {text!r}; it must be a whole number from 1 to {MOST}")
        return int(text)


# --- lines ------------------------------------------------------------------------------------------------------------


class LineFramer(WholeFramer):
    cut_off = "half a request, whose end did not come"

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """The lines that these bytes complete, in order."""
        self.dropped.clear()
        *whole, rest = (bytes(self._pending) + data).split(b"\n")
        frames = [line + b"\n" for line in whole]
        if self._lost and frames:
            self.dropped.add(frames.pop(0), TOO_LONG)
            self._lost = False
        if len(rest) > LONGEST:
            self.dropped.add(rest, TOO_LONG)
            rest, self._lost = b"", True
        self._pending = bytearray(rest)
        return frames
