"""The order in which an unknown serial line is asked what it is, so that no question can do harm.

First silence: a command that another program left half finished must be dropped before more bytes can complete it, and
a device that talks by itself is no mount. Then ``Kx``, which a hand control echoes as ``x#`` and an LX200 ignores. Then
the single byte 0x06, which a Meade answers with one letter and no hand control takes for a command. Nothing that begins
with ``:`` is sent unless the user has named the protocol, because a hand control would take parts of it for commands:
``:GR#`` holds an ``R``, which is a goto.
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

#: What a stranger answers who was asked at its own rate; anything else may be an answer at another one.
_TEXT = re.compile(rb"[ -~\r\n\t]+")
_SENTENCE = re.compile(rb"\$([A-Z]{4,6},[^\r\n*$]*)\*([0-9A-F]{2})")


class Verdict(StrEnum):
    """What a port turned out to be where it is no mount. A mount is the name of its protocol, or a state of it."""

    SILENT = "silent"
    ECHO = "echo"
    GPS = "gps"
    TALKER = "talker"
    STRANGER = "stranger"
    GARBLED = "garbled"


class Patience(Struct, frozen=True):
    """Seconds: ``quiet`` before the first byte, given up after ``restless``; ``first`` from one question to the next;
    ``answer`` from the first question to the end.
    """

    quiet: float
    restless: float
    first: float
    answer: float


#: At 9600: a hand control drops half a command after a second, and may take 3.5 s to answer (NexStar protocol,
#: Developer Notes). ACK goes out while its answer may still come: it is waited for all the same.
AT_9600 = Patience(quiet=1.05, restless=2.5, first=0.6, answer=3.5)
#: At other rates only a Meade is to be expected, which answers at once. The last question of one rate and the first of
#: the next are a second apart, too.
ELSEWHERE = Patience(quiet=0.3, restless=1.5, first=0.3, answer=1.05)


def questions(named: str | None) -> list[Question]:
    """What a line may be asked, in order.

    Who names a protocol may be wrong: the questions before its own are asked, too, and none behind them.
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
    """Ask an open line who it is. Raises OSError when the port vanishes meanwhile."""
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
    """Listen to somebody who talks, without a word: a GPS receiver, or nobody knows who. Raises OSError."""
    return await _wait(ear, seconds, lambda: Verdict.GPS if sentence(ear.heard) else None) or Verdict.TALKER


def _judge(ear: PortListener, question: Question) -> str | None:
    return judge(ear.heard, ear.still, question)


def judge(heard: bytes, still: float, question: Question) -> str | None:
    """What the bytes after a question say; None while they may mean anything. ``still`` is seconds since the last.

    The answer to the question before may come late.
    """
    before = [asked for spec in PROTOCOLS.values() for asked in spec.questions if asked.rank < question.rank]
    if heard.startswith((question.request, *(asked.request for asked in before if asked.late))):
        return Verdict.ECHO
    for asked in (*(asked for asked in before if asked.late), question):
        if (said := asked.judge(heard, still)) is not None:
            return said
    return None


def sentence(heard: bytes) -> bool:
    """Whether a whole NMEA 0183 sentence is among these bytes, by its checksum."""
    return any(
        NMEASentence.checksum(body.decode("latin-1")) == int(check, 16) for body, check in _SENTENCE.findall(heard)
    )


async def _fell_quiet(ear: PortListener, patience: Patience) -> bool:
    """Wait until nothing has come for a while. Opening a port often makes a stray byte: that alone is no talk."""
    end = ear.now() + patience.restless
    while ear.still < patience.quiet:
        if sentence(ear.heard) or ear.now() > end:
            return False
        await ear.tick()
    return True


async def _wait(ear: PortListener, seconds: float, condition: Callable[[], str | None]) -> str | None:
    """The first verdict in time, or None."""
    end = ear.now() + seconds
    while ear.now() < end:
        await ear.tick()
        verdict = condition()
        if verdict is not None:
            return verdict
    return None
