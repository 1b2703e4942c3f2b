"""Talking to a Meade: requests out, replies in.

A reply has one of five shapes: none, one character, text up to ``#``, one character and text, two texts (``:SC``). A
raw 0x15 instead of any of them, of none too, means busy (LX200GPS). Commands without a reply are followed by a short
pause, which old scopes need. Clients may write sloppily, telescopes do not: a reply counts in its exact form only.

How one telescope writes what all of them tell is learnt from its answers, for programs that see the mount itself. The
digits are the gateway's; the marks between them, the seconds behind a site, the sign before a longitude or a rate are
the telescope's.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache

from gateway.core import errors
from gateway.core.errors import Busy, Fault, Garbled, Refused
from gateway.core.operations import Values
from gateway.protocols.base.driver import Send
from gateway.protocols.base.reply_rules import Expected, kind
from gateway.protocols.wireformat.command_set import CommandSet, load

NAK = 0x15
TIMEOUT, PACE = 3.0, 0.05  # seconds
#: No reply with a ``#`` at its end is longer.
LONGEST = 200
#: Field forms as telescopes send them: every digit in its place, any one byte between degrees, minutes and seconds.
_SEP = rb"[^0-9#]"
_FORMS = {
    "HH:MM:SS": rb"\d\d" + _SEP + rb"\d\d" + _SEP + rb"\d\d",
    "hh:mm:ss": rb"\d\d" + _SEP + rb"\d\d" + _SEP + rb"\d\d",
    "HH:MM.T": rb"\d\d" + _SEP + rb"\d\d\.\d",
    "sDD*MM:SS": rb"[+-]\d\d" + _SEP + rb"\d\d" + _SEP + rb"\d\d",
    "sDD*MM": rb"[+-]\d\d" + _SEP + rb"\d\d(?:" + _SEP + rb"\d\d)?",
    "DDD*MM:SS": rb"\d\d\d" + _SEP + rb"\d\d" + _SEP + rb"\d\d",
    "DDD*MM": rb"\d\d\d" + _SEP + rb"\d\d",
    "sDDD*MM": rb"[+-]?\d\d\d" + _SEP + rb"\d\d(?:" + _SEP + rb"\d\d)?",
    "MM/DD/YY": rb"\d\d/\d\d/\d\d",
    "sHH.H": rb"[+-]?\d\d?(?:[.:]\d\d?)?",
}
_FIELD = re.compile(r"\{\w+:([^}]*)\}")


@cache
def _exact(source: str) -> re.Pattern[bytes]:
    """A reply's picture as telescopes fill it."""
    pattern, at = b"", 0
    for field in _FIELD.finditer(source):
        pattern += re.escape(source[at : field.start()].encode("latin-1"))
        form, at = field[1], field.end()
        words = [len(word) for word in form.split("|")]
        free = rb"[^#]*" if len(words) == 1 else rb"[^#]{%d,%d}" % (min(words), max(words))
        pattern += _FORMS.get(form, free)
    return re.compile(pattern + re.escape(source[at:].encode("latin-1")), re.DOTALL)


@cache
def _shapes(sources: tuple[str, ...]) -> frozenset[str]:
    """What replies look like when one does not know what was asked."""
    shapes = set()
    for source in sources:
        if ":text}" in source:
            shapes.add("text")
        elif "#" in source:
            shapes.add(_FIELD.sub(lambda field: field[1].upper(), source))
        else:
            shapes.add("bare")
    return frozenset(shapes)


#: Whose answers show how a telescope writes, and what is written like another command's answer.
EXAMPLES = frozenset({"GR", "GD", "GZ", "GA", "GT", "Gt", "Gg"})
SITE = frozenset({"Gt", "Gg"})
LIKE = {"Gr": "GR", "Gd": "GD"}
#: A reply in degrees, as it is written by the manual, and the marks in it.
_MARKED = re.compile(rb"([+-]?)(\d{2,3})\*(\d\d)?(?::\d\d)?#")
_MARKS = b"*:"
#: Where the mark behind the degrees stands in a declination.
_DEGREE = slice(3, 4)
_TURN = 360 * 60


class Handwriting:
    """``learn`` takes answers as they came, ``write`` gives a reply by the manual as this telescope would write it."""

    def __init__(self) -> None:
        self._examples: dict[str, bytes] = {}
        self._degree = b"*"

    def learn(self, command: str, answer: bytes) -> None:
        if command in EXAMPLES:
            self._examples[command] = answer
        if command == "GD":
            self._degree = answer[_DEGREE]

    def write(self, command: str, reply: bytes) -> bytes:
        """What the telescope has never told is written with its degree sign alone."""
        example = self._examples.get(LIKE.get(command, command), b"")
        if command == "GT":
            return b"+" + reply if example.startswith(b"+") and reply[:1].isdigit() else reply
        found = _MARKED.fullmatch(reply)
        if found is None:
            return reply
        if command == "Gg" and example[:1].isdigit():  # west from 0 to 360, without a sign
            minutes = int(found[2]) * 60 + int(found[3] or b"0")
            reply = b"%03d*%02d#" % divmod((-minutes if found[1] == b"-" else minutes) % _TURN, 60)
        if command in SITE and len(example) == len(reply) + 3:  # the telescope tells seconds
            reply = reply[:-1] + b":00#"
        if len(example) == len(reply):
            return bytes(own if digit in _MARKS else digit for own, digit in zip(example, reply, strict=True))
        return reply.replace(b"*", self._degree)


class Lx200ReplyRules:
    protocol: CommandSet = load("lx200")
    closing = b"#"

    def __init__(self) -> None:
        self._hand = Handwriting()

    def expected(self, ask: Send) -> Expected:
        """ACK has no end: whoever reads whole commands takes what comes next for the rest of it."""
        return _expected(ask.command, ask.once, ask.raw)

    def as_written(self, command: str, reply: bytes) -> bytes:
        return self._hand.write(command, reply)

    def alike(self, one: Send, other: Send) -> bool:
        """Whether the reply to the one could be taken for a reply to the other, by their forms."""
        first, second = _shapes(_sources(one.command)), _shapes(_sources(other.command))
        either = first | second
        return bool(first & second) or ("text" in either and bool(first - {"bare"}) and bool(second - {"bare"}))

    def encode(self, ask: Send) -> bytes:
        """The request bytes; with ``low`` among the values in the low-precision form."""
        requests = self.protocol.commands[ask.command].requests
        try:
            return requests[1 if ask.values.get("low") and len(requests) > 1 else 0].encode(ask.values)
        except ValueError as error:
            raise Refused(str(error)) from None

    def take(self, ask: Send, buffer: bytes) -> tuple[Values | Fault, int] | None:
        """The reply at the start of the buffer and its length; None while it is incomplete.

        The fields come with ``length``: only by that is low precision told from high. Raises ValueError for a field
        that is out of range.
        """
        replies = self.protocol.commands[ask.command].replies
        if buffer[:1] == bytes((NAK,)):
            return Busy(), 1
        if not replies:
            return {}, 0
        if not buffer:
            return None
        for reply, template in replies:
            found = _exact(str(template.source)).match(buffer)
            if found is None:
                continue
            length = found.end()
            if "#" not in str(template.source) and buffer[length:] == b"#":
                buffer, length = buffer[:length], length + 1  # some put one behind everything
            values = template.decode(found[0])
            if reply.fault is not None:
                return _fault(reply.fault, values), length
            self._hand.learn(ask.command, found[0])
            return {**values, "length": length}, length
        hashes = max(source.count("#") for source in _sources(ask.command))
        if buffer.count(b"#") >= max(1, hashes) or len(buffer) > LONGEST or not hashes:
            whole = hashes or len(buffer) >= max(template.width or 1 for _, template in replies)
            return (Garbled(), len(buffer)) if whole else None
        return None

    def proof(self, number: int) -> Iterator[Send]:
        """After quiet time: a right ascension and a declination, whose forms differ."""
        yield Send("GR")
        yield Send("GD")

    def proven(self, ask: Send, values: Values) -> bool:
        return "ra" in values or "dec" in values


@cache
def _sources(command: str) -> tuple[str, ...]:
    """The pictures of a command's replies."""
    return tuple([str(template.source) for _, template in Lx200ReplyRules.protocol.commands[command].replies])


@cache
def _expected(command: str, once: bool, raw: bool) -> Expected:
    protocol, sources = Lx200ReplyRules.protocol, _sources(command)
    return Expected(
        kind(protocol, command, once, raw),
        TIMEOUT,
        bare=any("#" not in source for source in sources),
        pace=0.0 if sources else PACE,
        silent=not sources,
        leaves_open=command == "ACK",
    )


def _fault(name: str, values: Values) -> Fault:
    """The fault that a reply variant stands for, with the mount's own words where it sent some."""
    fault: type[Fault] = getattr(errors, name)
    words = str(values.get("text", "")).strip()
    return fault(" ".join(words.split()) or None)
