"""The datagrams between a command and a gateway, and their seal.

A datagram is ``SEAL NUMBER TEXT``. The number is drawn by the side that asks and repeated in the answer; the seal is an
HMAC of the rest. A long answer is sent in numbered parts, because the system limits the size of a datagram.
"""

from __future__ import annotations

import hmac
import secrets

#: Characters of a part: 8 kB at most, as 9 kB are what a datagram holds on macOS.
PART = 2000
#: Says that an order was heard and is being carried out.
WAIT = "wait"
#: The largest datagram that is looked at.
LARGEST = 9216


def draw() -> str:
    """A number that nobody has drawn before."""
    return secrets.token_hex(8)


def seal(secret: str, number: str, text: str) -> bytes:
    """A datagram."""
    told = f"{number} {text}"
    return f"{_seal(secret, told)} {told}".encode()


def unseal(secret: str, data: bytes) -> tuple[str, str] | None:
    """-> the number and the text, or None for what was not sealed with this secret."""
    given, _, told = data.decode("utf-8", "replace").partition(" ")
    if len(data) > LARGEST or not hmac.compare_digest(given.encode(), _seal(secret, told).encode()):
        return None
    number, _, text = told.partition(" ")
    return number, text


def _seal(secret: str, told: str) -> str:
    return hmac.digest(secret.encode(), told.encode(), "sha256").hex()


def parts(text: str) -> list[str]:
    """An answer as ``tell PLACE COUNT PART``, in as many as it takes."""
    pieces = [text[start : start + PART] for start in range(0, len(text), PART)] or [""]
    return [f"tell {place} {len(pieces)} {piece}" for place, piece in enumerate(pieces)]


class Parts:
    """The parts of an answer, in whatever order they come."""

    def __init__(self) -> None:
        self._pieces: dict[int, str] = {}

    def add(self, text: str) -> str | None:
        """One of them -> the answer when it was the last that was missing. What is no part is ignored."""
        word, _, rest = text.partition(" ")
        place, _, rest = rest.partition(" ")
        count, _, piece = rest.partition(" ")
        if word == "tell" and place.isdecimal() and count.isdecimal() and int(place) < int(count):
            self._pieces[int(place)] = piece
            if len(self._pieces) == int(count):
                return "".join(self._pieces[index] for index in sorted(self._pieces))
        return None
