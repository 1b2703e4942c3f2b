"""Query an unknown serial device in an order in which no query can do harm.

First wait for silence: a command that another program left incomplete must time out before more bytes could complete
it, and a device that sends by itself is no mount. Then send ``Kx``, which a hand control echoes as ``x#`` and an LX200
ignores. Then send ``#`` and the single byte 0x06, which a Meade answers with one letter and which is no command of a
hand control; the ``#`` is for controllers that take the ``K`` for the beginning of a command. Nothing that begins with
``:`` is sent unless the user has named the protocol, because a hand control would take parts of it for commands:
``:GR#`` contains an ``R``, which is a goto.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from enum import StrEnum
from functools import partial

from msgspec import Struct
from pynmea2 import NMEASentence

from gateway.diagnostics.detect.port_listener import PortListener
from gateway.protocols.base.spec import Question
from gateway.protocols.registry import PROTOCOLS

#: The answer of an unknown device at its own baud rate; other bytes may come from a device at another rate.
_TEXT = re.compile(rb"[ -~\r\n\t]+")
_SENTENCE = re.compile(rb"\$([A-Z]{4,6},[^\r\n*$]*)\*([0-9A-F]{2})")


class Verdict(StrEnum):
    """The result for a port without a mount. For a mount it is the name of its protocol, or one of its states."""

    SILENT = "silent"
    ECHO = "echo"
    GPS = "gps"
    TALKER = "talker"
    STRANGER = "stranger"
    GARBLED = "garbled"


class Patience(Struct, frozen=True):
    """Times in seconds: silence of ``quiet`` is required before the first query, for at most ``restless``; ``first``
    passes from one query to the next, ``answer`` from the first query to the end.
    """

    quiet: float
    restless: float
    first: float
    answer: float


#: At 9600 baud: a hand control discards an incomplete command after a second, and may take 3.5 s to answer (NexStar
#: protocol, Developer Notes). ACK is sent while that answer may still arrive; waiting for it continues.
AT_9600 = Patience(quiet=1.05, restless=2.5, first=0.6, answer=3.5)
#: At other rates only a Meade can be expected, which answers at once. The last query at one rate and the first at the
#: next are a second apart, too.
ELSEWHERE = Patience(quiet=0.3, restless=1.5, first=0.3, answer=1.05)


def questions(named: str | None) -> list[Question]:
    """Return the queries that may be sent, in order.

    A user who names a protocol may be wrong: the queries that come before its own are sent as well, later ones are not.
    """
    every = sorted(
        ((spec.name, question) for spec in PROTOCOLS.values() for question in spec.questions),
        key=lambda found: found[1].rank,
    )
    last = max((question.rank for name, question in every if name == named), default=None)
    return [
        question
        for name, question in every
        if (not question.named or name == named) and (last is None or question.rank <= last)
    ]


async def probe(ear: PortListener, patience: Patience, named: str | None = None) -> str:
    """Query an open port and return the verdict. Raises OSError if the port disappears meanwhile."""
    if not await _fell_quiet(ear, patience):
        return Verdict.GPS if sentence(ear.heard) else Verdict.TALKER
    ear.forget()
    asked = questions(named)
    waits = [patience.first] * (len(asked) - 1)
    waits.append(patience.answer - sum(waits))
    for question, seconds in zip(asked, waits, strict=True):
        ear.write(question.request)
        verdict = await _wait(ear, seconds, partial(_judge, ear, question))
        if verdict is not None:
            return verdict
    if not ear.heard:
        return Verdict.SILENT
    if sentence(ear.heard):
        return Verdict.GPS
    return Verdict.STRANGER if _TEXT.fullmatch(ear.heard) else Verdict.GARBLED


async def overhear(ear: PortListener, seconds: float) -> str:
    """Listen to a device that sends by itself and tell whether it is a GPS receiver. Raises OSError."""
    return await _wait(ear, seconds, lambda: Verdict.GPS if sentence(ear.heard) else None) or Verdict.TALKER


def _judge(ear: PortListener, question: Question) -> str | None:
    return judge(ear.heard, ear.still, question)


def judge(heard: bytes, still: float, question: Question) -> str | None:
    """Return the verdict of the bytes received after a query; None while they are ambiguous.

    ``still`` is the time since the last byte in seconds. The answer to the query before may arrive late.
    """
    before = [asked for spec in PROTOCOLS.values() for asked in spec.questions if asked.rank < question.rank]
    if heard.startswith((question.request, *(asked.request for asked in before if asked.late))):
        return Verdict.ECHO
    for asked in (*(asked for asked in before if asked.late), question):
        if (said := asked.judge(heard, still)) is not None:
            return said
    return None


def sentence(heard: bytes) -> bool:
    """Whether these bytes contain a complete NMEA 0183 sentence with a valid checksum."""
    return any(
        NMEASentence.checksum(body.decode("latin-1")) == int(check, 16) for body, check in _SENTENCE.findall(heard)
    )


async def _fell_quiet(ear: PortListener, patience: Patience) -> bool:
    """Wait until nothing has arrived for a while. One stray byte is ignored: opening a port often causes one."""
    end = ear.now() + patience.restless
    while ear.still < patience.quiet:
        if sentence(ear.heard) or ear.now() > end:
            return False
        await ear.tick()
    return True


async def _wait(ear: PortListener, seconds: float, condition: Callable[[], str | None]) -> str | None:
    """Wait for a verdict; return None on timeout."""
    end = ear.now() + seconds
    while ear.now() < end:
        await ear.tick()
        verdict = condition()
        if verdict is not None:
            return verdict
    return None
