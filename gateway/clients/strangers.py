"""Who is no program for telescopes: the first bytes by which a web browser, a port scanner, a proxy are told.

Only the beginning of a connection is looked at. There nothing that a mount's program says can be taken for one of
these; later the same bytes may be part of a site's name, or the digits of an angle. What they say is
``mappings/strangers.toml``; an HTTP request whose method is no known one is told by its form.

What may still become such a greeting is held back. A complete, well-formed command never waits, even where a greeting
could follow (``E`` may become ``EHLO``), so no reply is late because of this. Halves of commands wait, and so does what
is no command. No greeting contains a well-formed command that does more than ask, so nothing a stranger sends is
carried out. Once the sender is known, this is bypassed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

from msgspec import Struct

from gateway.core.tables import read_table
from gateway.protocols.registry import PROTOCOLS

#: What a method may consist of (RFC 9110), what an address may, and the longest word that is looked at.
_WORD = frozenset(b"!#$%&'*+-.^_`|~0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz")
_PRINTABLE = frozenset(range(0x20, 0x7F))
_BEHIND = (frozenset(b" "), frozenset(b"/"), _PRINTABLE, _PRINTABLE)
LONGEST = 65536
#: What programs send in front of their first command: it ends nothing, asks nothing, and both protocols pass it over.
IDLE = b"#\r\n\0 ?"

#: One byte of a greeting: the values that it may have.
Octet = frozenset[int]


class Greeting(Struct, frozen=True):
    """What a stranger begins with: the bytes ``first`` decide, ``words`` follow "sends" in the log."""

    words: str
    first: tuple[Octet, ...]
    #: A page is shown to whoever sends it; HEAD is answered without the page's text.
    http: bool = False
    head_only: bool = False


#: The one that is told by its form.
OWN_METHOD = Greeting("an HTTP request with a method of its own", (), http=True)


def _from_text(text: str) -> tuple[Octet, ...]:
    return tuple(frozenset((byte,)) for byte in text.encode("latin-1"))


def _from_hexadecimal(text: str) -> tuple[Octet, ...]:
    """``05 01-02 ..``: bytes, ranges, and any byte."""
    octets = []
    for word in text.split():
        low, _, high = word.partition("-")
        octets.append(frozenset(range(256) if word == ".." else range(int(low, 16), int(high or low, 16) + 1)))
    return tuple(octets)


def _greetings() -> Iterator[Greeting]:
    table = read_table("strangers.toml")
    for words, methods in table["methods"].items():
        for method in methods:
            yield Greeting(words, _from_text(f"{method} "), http=True, head_only=method == "HEAD")
    for words, texts in table["texts"].items():
        for text in texts:
            yield Greeting(words, _from_text(text), http=text.startswith("PRI"))
    for words, rows in table["bytes"].items():
        for row in rows:
            yield Greeting(words, _from_hexadecimal(row))


def _of_protocols(own: str) -> Iterator[Greeting]:
    """The greetings of programs that speak another protocol than the surface's ``own``."""
    for spec in PROTOCOLS.values():
        if spec.greeting and spec.name != own:
            words = f"{spec.title}'s own protocol (for that add --surface {spec.name}@tcp://HOST:{spec.usual_port}"
            choice = f", or choose {PROTOCOLS[own].title} in the program)" if own in PROTOCOLS else ")"
            yield Greeting(words + choice, tuple(frozenset((byte,)) for byte in spec.greeting))


@cache
def greetings(own: str = "") -> tuple[Greeting, ...]:
    """On a surface of that protocol. Worked out for the first connection: the start of the gateway does not wait."""
    return (*_greetings(), *_of_protocols(own))


@cache
def _beginning_with(byte: int, own: str) -> list[Greeting]:
    """The greetings that may begin with a byte."""
    return [greeting for greeting in greetings(own) if byte in greeting.first[0]]


class OwnMethod:
    """Hears whether a connection begins with an HTTP request whose method is no known one.

    A web page may choose any word where it was given our address. (DNS rebinding: the page's own name points here, so
    the browser asks nobody.) Whatever the word, a blank, the ``/`` of the address and two printable characters follow;
    no program for telescopes begins so, though a latitude of 32°47' comes near. The word itself holds nothing up,
    because every single letter may be a command.
    """

    def __init__(self) -> None:
        self._letters, self._behind = 0, 0
        #: Whether such a request may still come.
        self.possible = True

    @property
    def begun(self) -> bool:
        """Whether the blank has come: what follows is not to be heard before it is known what it is."""
        return self.possible and self._behind > 0

    def hear(self, data: bytes) -> bool:
        """More bytes have come -> whether they complete what such a request begins with."""
        for byte in data if self.possible else b"":
            if not self._letters and byte in IDLE:
                continue
            if self._letters and byte in _BEHIND[self._behind]:
                self._behind += 1
                if self._behind == len(_BEHIND):
                    self.possible = False
                    return True
            elif self._behind or byte not in _WORD or self._letters == LONGEST:
                self.possible = False
                break
            else:
                self._letters += 1
        return False


class Recogniser:
    """Hears a connection from its first byte on, in pieces of any size, until it is known who it cannot be.

    ``own`` is the protocol that is spoken here. What it remembers is how far every greeting has matched, so that it
    needs no more memory than the table has bytes.
    """

    def __init__(self, own: str = "") -> None:
        self._own = own
        #: Whether one of the table may still be recognised.
        self._known = True
        self._own_method = OwnMethod()
        self._begun: list[tuple[Greeting, int]] = []
        self._leading = True

    @property
    def open(self) -> bool:
        """Whether what has come may be the beginning of a greeting."""
        return self._known or self._own_method.begun

    @property
    def over(self) -> bool:
        """Whether no stranger can be recognised any more."""
        return not (self._known or self._own_method.possible)

    def hear(self, data: bytes) -> Greeting | None:
        """More bytes have come -> the greeting that they complete, if they do."""
        known = self._hear_known(data) if self._known else None
        return OWN_METHOD if self._own_method.hear(data) and known is None else known

    def _hear_known(self, data: bytes) -> Greeting | None:
        for byte in data:
            begun = [(greeting, count + 1) for greeting, count in self._begun if byte in greeting.first[count]]
            if self._leading:
                begun += [(greeting, 1) for greeting in _beginning_with(byte, self._own)]
                self._leading = byte in IDLE
            for greeting, count in begun:
                if count == len(greeting.first):
                    self._known = False
                    return greeting
            self._begun = begun
            if not begun and not self._leading:
                self._known = False
                break
        return None


def page(speaks: str, head_only: bool = False) -> bytes:
    """What a web browser is shown: a whole HTTP/1.1 answer in plain words. ``speaks``: the port's own protocol."""
    text = (
        '<!doctype html>\n<html lang="en">\n<title>mount-gateway</title>\n<link rel="icon" href="data:,">\n'
        f"<p>This port of mount-gateway is for telescope programs that speak {speaks}.\n"
        "<p>A web browser can do nothing here, and nothing of its request has reached the mount.\n"
        "To use the mount, enter this address and this port in your telescope program.\n"
    ).encode()
    head = (
        "HTTP/1.1 400 Bad Request\r\nContent-Type: text/html; charset=utf-8\r\n"
        f"Content-Length: {len(text)}\r\nCache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\n"
        "Connection: close\r\n\r\n"
    ).encode()
    return head if head_only else head + text


class Piece(NamedTuple):
    """Bytes as they came, when (loop time), and how many stops there had been by then."""

    data: bytes
    at: float
    stops: int


class Beginning:
    """``commands`` matches all well-formed commands of the protocol ``own``, and what is passed over, that bytes begin
    with.
    """

    def __init__(self, commands: re.Pattern[bytes], own: str = "") -> None:
        self._commands = commands
        self._recogniser = Recogniser(own)
        self._waiting: list[Piece] = []
        #: Who it is, when it is a stranger.
        self.stranger: Greeting | None = None

    @property
    def waiting(self) -> bytes:
        """What was held back until now, because it may be a stranger's."""
        return b"".join(piece.data for piece in self._waiting)

    @property
    def over(self) -> bool:
        return self._recogniser.over

    def hear(self, piece: Piece) -> list[Piece]:
        """More bytes have come -> those that may go on to the mount's client now; none of a stranger."""
        self.stranger = self._recogniser.hear(piece.data)
        if self.stranger is not None:
            self._waiting.clear()
            return []
        self._waiting.append(piece)
        if self._recogniser.open:
            found = self._commands.match(self.waiting)
            return self._first(found.end() if found else 0)
        return self._first(sum(len(piece.data) for piece in self._waiting))

    def _first(self, count: int) -> list[Piece]:
        """Take so many bytes out of those that wait."""
        going: list[Piece] = []
        while count > 0:
            piece = self._waiting.pop(0)
            if len(piece.data) > count:
                self._waiting.insert(0, piece._replace(data=piece.data[count:]))
                piece = piece._replace(data=piece.data[:count])
            going.append(piece)
            count -= len(piece.data)
        return going
