"""How one telescope writes what all of them tell: learnt from its answers, for programs that see the mount itself.

The digits are the gateway's; the marks between them, the seconds behind a site, the sign before a longitude or a rate
are the telescope's.
"""

from __future__ import annotations

import re

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
        """An answer has come."""
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
        if command == "Gg" and example[:1].isdigit():
            reply = _unsigned(found)
        if command in SITE and len(example) == len(reply) + 3:  # the telescope tells seconds
            reply = reply[:-1] + b":00#"
        if len(example) == len(reply):
            return bytes(own if digit in _MARKS else digit for own, digit in zip(example, reply, strict=True))
        return reply.replace(b"*", self._degree)


def _unsigned(found: re.Match[bytes]) -> bytes:
    """A longitude west from 0 to 360, of one with a sign."""
    minutes = (int(found[2]) * 60 + int(found[3] or b"0")) * (-1 if found[1] == b"-" else 1) % _TURN
    return b"%03d*%02d#" % divmod(minutes, 60)
