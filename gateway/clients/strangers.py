"""Recognises strangers (web browsers, port scanners, proxies) by their greeting, the first bytes of their connection.

``mappings/strangers.toml`` lists the greetings; an HTTP request with an unknown method is recognised by its form. Bytes
that may still become a greeting are held back, and so are incomplete commands. A complete, well-formed command never
waits, even if it may also begin a greeting (``E`` may become ``EHLO``), so no reply is delayed. No greeting contains a
well-formed command that does more than read, so no command of a stranger changes anything.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

from msgspec import Struct

from gateway.core.tables import read_table
from gateway.protocols.registry import PROTOCOLS
from gateway.transport.web_server import response_bytes

#: Characters of an HTTP method (RFC 9110), and of each of the four places after it; the longest method examined.
_METHOD_CHARACTERS = frozenset(b"!#$%&'*+-.^_`|~0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz")
_PRINTABLE = frozenset(range(0x20, 0x7F))
_AFTER_METHOD = (frozenset(b" "), frozenset(b"/"), _PRINTABLE, _PRINTABLE)
MAX_METHOD_LENGTH = 65536
#: Bytes that clients may send before their first command; all protocols ignore them.
IDLE_BYTES = b"#\r\n\0 ?"

#: The values that a byte of a greeting may have.
ByteValues = frozenset[int]


class Greeting(Struct, frozen=True):
    """The first bytes of a stranger: for each byte its possible values; ``description`` follows "sends" in the log."""

    description: str
    pattern: tuple[ByteValues, ...]
    #: Whether the stranger gets an answer over HTTP.
    is_http: bool = False


#: Any HTTP request whose method is not in the table.
UNKNOWN_METHOD_GREETING = Greeting("an HTTP request with a method of its own", (), is_http=True)


#: For each byte, the set of this byte only. All greetings share these sets, so that the table loads faster.
_SINGLE_BYTE_VALUES = [frozenset((byte,)) for byte in range(256)]


def _pattern_from_bytes(data: bytes) -> tuple[ByteValues, ...]:
    return tuple(_SINGLE_BYTE_VALUES[byte] for byte in data)


def _pattern_from_hexadecimal(text: str) -> tuple[ByteValues, ...]:
    """Parse ``05 01-02 ..``: bytes, ranges, and ``..`` for any byte."""
    octets = []
    for word in text.split():
        low, _, high = word.partition("-")
        octets.append(frozenset(range(256) if word == ".." else range(int(low, 16), int(high or low, 16) + 1)))
    return tuple(octets)


def _stranger_greetings() -> Iterator[Greeting]:
    """Yield the greetings of the table, which is read at the first connection to keep the start fast."""
    table = read_table("strangers.toml")
    for description, methods in table["methods"].items():
        for method in methods:
            yield Greeting(description, _pattern_from_bytes(f"{method} ".encode()), is_http=True)
    for description, texts in table["texts"].items():
        for text in texts:
            yield Greeting(description, _pattern_from_bytes(text.encode("latin-1")), is_http=text.startswith("PRI"))
    for description, rows in table["bytes"].items():
        for row in rows:
            yield Greeting(description, _pattern_from_hexadecimal(row))


def _protocol_greetings(protocol: str) -> Iterator[Greeting]:
    """Yield the greetings of telescope protocols' clients, except those of ``protocol``, which the surface serves."""
    for spec in PROTOCOLS.values():
        if spec.greeting and spec.name != protocol:
            description = (
                f"{spec.title}'s own protocol (for that add --surface {spec.name}@tcp://HOST:{spec.usual_port}"
            )
            choice = f", or choose {PROTOCOLS[protocol].title} in the program)" if protocol in PROTOCOLS else ")"
            yield Greeting(description + choice, _pattern_from_bytes(spec.greeting))


@cache
def greetings(served_protocol: str = "") -> tuple[Greeting, ...]:
    """Return the greetings of strangers on a surface for ``served_protocol``, including other protocols' clients."""
    return (*_stranger_greetings(), *_protocol_greetings(served_protocol))


@cache
def _greetings_beginning_with(byte: int, served_protocol: str) -> list[Greeting]:
    """Return the greetings that may begin with this byte."""
    return [greeting for greeting in greetings(served_protocol) if byte in greeting.pattern[0]]


class UnknownMethodMatcher:
    """Recognises an HTTP request with an unknown method at the beginning of a connection.

    A web page whose host name resolves to this computer (DNS rebinding) may send any word as the method, without the
    browser asking for permission. The word is followed by a space, the ``/`` of the path and two printable characters.
    No telescope program begins like this. The word itself is not held back, because each letter may be a command;
    the following bytes are.
    """

    def __init__(self) -> None:
        self._method_length, self._tail_length = 0, 0
        #: Whether such a request may still arrive.
        self.may_match = True

    @property
    def is_partly_matched(self) -> bool:
        """Whether a method and the space after it have arrived; then the following bytes are held back."""
        return self.may_match and self._tail_length > 0

    def feed(self, data: bytes) -> bool:
        """Examine more bytes. Return whether an HTTP request is recognised now."""
        for byte in data if self.may_match else b"":
            if not self._method_length and byte in IDLE_BYTES:
                continue
            if self._method_length and byte in _AFTER_METHOD[self._tail_length]:
                self._tail_length += 1
                if self._tail_length == len(_AFTER_METHOD):
                    self.may_match = False
                    return True
            elif self._tail_length or byte not in _METHOD_CHARACTERS or self._method_length == MAX_METHOD_LENGTH:
                self.may_match = False
                break
            else:
                self._method_length += 1
        return False


class StrangerRecogniser:
    """Examines the first bytes of a connection, in pieces of any size, until the client cannot be a stranger.
    ``served_protocol`` is the protocol of the surface. To limit memory, the bytes are not stored.
    """

    def __init__(self, served_protocol: str = "") -> None:
        self._served_protocol = served_protocol
        #: Whether a greeting of the table may still be recognised.
        self._table_may_match = True
        self._method_matcher = UnknownMethodMatcher()
        self._candidates: list[tuple[Greeting, int]] = []
        self._in_idle_bytes = True

    @property
    def may_be_greeting(self) -> bool:
        """Whether the bytes so far may be the beginning of a greeting and must be held back."""
        return self._table_may_match or self._method_matcher.is_partly_matched

    @property
    def is_done(self) -> bool:
        """Whether no further bytes can complete a greeting."""
        return not (self._table_may_match or self._method_matcher.may_match)

    def feed(self, data: bytes) -> Greeting | None:
        """Examine more bytes. Return the greeting that they complete, if any."""
        known = self._match_table(data) if self._table_may_match else None
        return UNKNOWN_METHOD_GREETING if self._method_matcher.feed(data) and known is None else known

    def _match_table(self, data: bytes) -> Greeting | None:
        for byte in data:
            partial = [(greeting, count + 1) for greeting, count in self._candidates if byte in greeting.pattern[count]]
            if self._in_idle_bytes:
                partial += [(greeting, 1) for greeting in _greetings_beginning_with(byte, self._served_protocol)]
                self._in_idle_bytes = byte in IDLE_BYTES
            for greeting, count in partial:
                if count == len(greeting.pattern):
                    self._table_may_match = False
                    return greeting
            self._candidates = partial
            if not partial and not self._in_idle_bytes:
                self._table_may_match = False
                break
        return None


def http_answer(protocol_titles: str) -> bytes:
    """Return the answer to a stranger that speaks HTTP. ``protocol_titles`` names the port's protocols."""
    return response_bytes(
        "400 Bad Request",
        f"This port of mount-gateway is for telescope programs that speak {protocol_titles}.\n"
        "To use the mount, enter this address and port in your telescope program.\n",
    )


class ReceivedBytes(NamedTuple):
    """Received bytes, the loop time of their arrival, and the number of stops at that time."""

    data: bytes
    arrived_at: float
    stop_count: int


class StrangerFilter:
    """Holds back the first bytes of a connection until it is certain that no stranger sent them.
    ``command_pattern`` is a regular expression for the well-formed commands and idle bytes of ``served_protocol``.
    """

    def __init__(self, command_pattern: bytes, served_protocol: str = "") -> None:
        self._command_pattern = command_pattern
        self._recogniser = StrangerRecogniser(served_protocol)
        self._held_pieces: list[ReceivedBytes] = []
        #: The greeting of the stranger that was recognised; None while there is none.
        self.stranger: Greeting | None = None

    @property
    def held_bytes(self) -> bytes:
        """The bytes that are held back, because a stranger may have sent them."""
        return b"".join(piece.data for piece in self._held_pieces)

    @property
    def is_done(self) -> bool:
        return self._recogniser.is_done

    def feed(self, piece: ReceivedBytes) -> list[ReceivedBytes]:
        """Take more bytes. Return those that may be processed now; none if a stranger sent them."""
        self.stranger = self._recogniser.feed(piece.data)
        if self.stranger is not None:
            self._held_pieces.clear()
            return []
        self._held_pieces.append(piece)
        if self._recogniser.may_be_greeting:
            match = re.match(self._command_pattern, self.held_bytes)
            return self._release(match.end() if match else 0)
        return self._release(sum(len(piece.data) for piece in self._held_pieces))

    def _release(self, byte_count: int) -> list[ReceivedBytes]:
        """Remove the first ``byte_count`` held-back bytes and return them."""
        released: list[ReceivedBytes] = []
        while byte_count > 0:
            piece = self._held_pieces.pop(0)
            if len(piece.data) > byte_count:
                self._held_pieces.insert(0, piece._replace(data=piece.data[byte_count:]))
                piece = piece._replace(data=piece.data[:byte_count])
            released.append(piece)
            byte_count -= len(piece.data)
        return released
