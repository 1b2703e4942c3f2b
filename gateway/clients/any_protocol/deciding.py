"""Which protocol a program speaks, by the first bytes of its connection.

The protocols' own specifications and tables decide: a protocol is spoken where a whole command of it has come, or where
nothing else can become of what has come. HTTP is told by its methods; a letter that may become one of them is waited
for. What is no protocol's, or more than one's, is taken for the first protocol's, and the log is told why.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from gateway.clients.strangers import IDLE, greetings
from gateway.protocols.registry import PROTOCOLS, streams
from gateway.protocols.wireformat.command_set import load

#: In the place of a protocol: the connection is a web browser's, or another program's that speaks HTTP.
HTTP = "http"


class Verdict(NamedTuple):
    """What is spoken, and the reason where a person may want to know it."""

    protocol: str
    why: str = ""


def decide(sent: bytes) -> Verdict | None:
    """Told by these bytes, which begin with no idle ones; None where more must be heard."""
    if any(sent.startswith(method) for method in _methods()):
        return Verdict(HTTP)
    spoken = streams()
    whole = [name for name in spoken if (found := PROTOCOLS[name].opening.match(sent)) and found.end()]
    if whole:
        return Verdict(whole[0], _ambiguous(whole) if len(whole) > 1 else "")
    if any(method.startswith(sent) for method in _methods()):
        return None
    begun = [name for name in spoken if load(name).may_begin(sent)]
    begun = begun or [name for name in spoken if load(name).may_begin(sent[:1])]
    if len(begun) > 1:
        return None
    return Verdict(begun[0]) if begun else Verdict(spoken[0], "because no protocol's commands begin so")


def undecided(protocol: str, sent: bytes) -> int:
    """How many of these bytes are commands of the protocol that programs of other protocols begin with as well."""
    pattern = PROTOCOLS[protocol].also_others
    found = pattern.match(sent) if pattern is not None else None
    return found.end() if found is not None else 0


def may_change(protocol: str, sent: bytes) -> bool:
    """Whether a program that this was taken for, by these bytes, may still turn out to speak another protocol."""
    rest = sent.lstrip(IDLE)
    return PROTOCOLS[protocol].waits or (bool(rest) and undecided(protocol, rest) == len(rest))


def waiting() -> str | None:
    """The protocol of programs that wait for the first word."""
    return next((name for name in streams() if PROTOCOLS[name].waits), None)


def _ambiguous(protocols: list[str]) -> str:
    return f"which {' and '.join(PROTOCOLS[name].title for name in protocols)} programs may begin so"


@cache
def _methods() -> tuple[bytes, ...]:
    """What HTTP begins with. Each of these bytes has one value only."""
    return tuple(bytes(next(iter(octet)) for octet in greeting.first) for greeting in greetings() if greeting.http)
