"""Decides from the first bytes of a connection which protocol the client speaks.

The protocols' specifications and command tables decide: a whole command of a protocol has arrived, or the bytes can
only become a command of one protocol. HTTP is recognised by its methods; bytes that may become a method are not decided
yet. If a command fits several protocols, the first of them is chosen; bytes that fit none go to the first protocol.
"""

from __future__ import annotations

import re
from functools import cache
from typing import NamedTuple

from gateway.clients.strangers import IDLE_BYTES, greetings
from gateway.protocols.registry import PROTOCOLS, streams
from gateway.protocols.wireformat.command_set import load

#: The "protocol" of a web browser or another program that speaks HTTP.
HTTP_PROTOCOL = "http"


class Decision(NamedTuple):
    """The protocol of a connection, and a reason for the log if the decision is not obvious."""

    protocol: str
    reason: str = ""


def find_protocol(received: bytes) -> Decision | None:
    """Return the protocol of these first bytes (without idle bytes at the start); None if more bytes are needed."""
    if any(received.startswith(method) for method in _http_request_prefixes()):
        return Decision(HTTP_PROTOCOL)
    spoken = streams()
    whole = [name for name in spoken if (match := re.match(PROTOCOLS[name].opening_pattern, received)) and match.end()]
    if whole:
        titles = " and ".join(PROTOCOLS[name].title for name in whole)
        return Decision(whole[0], f"because {titles} programs may begin like this" if len(whole) > 1 else "")
    if any(method.startswith(received) for method in _http_request_prefixes()):
        return None
    begun = [name for name in spoken if load(name).may_begin(received)]
    begun = begun or [name for name in spoken if load(name).may_begin(received[:1])]
    if len(begun) > 1:
        return None
    return (
        Decision(begun[0]) if begun else Decision(spoken[0], "because no protocol has a command that begins like this")
    )


def shared_prefix_length(protocol: str, received: bytes) -> int:
    """Return how many bytes at the start are commands of ``protocol`` that clients of other protocols send, too."""
    pattern = PROTOCOLS[protocol].shared_pattern
    match = re.match(pattern, received) if pattern is not None else None
    return match.end() if match is not None else 0


def protocol_may_change(protocol: str, received: bytes) -> bool:
    """Whether a client that is assumed to speak this protocol, and has sent these bytes, may still speak another."""
    rest = received.lstrip(IDLE_BYTES)
    return PROTOCOLS[protocol].mount_speaks_first or (bool(rest) and shared_prefix_length(protocol, rest) == len(rest))


def greeting_protocol() -> str | None:
    """Return the protocol whose clients wait for a greeting before they send anything; None if there is none."""
    return next((name for name in streams() if PROTOCOLS[name].mount_speaks_first), None)


@cache
def _http_request_prefixes() -> tuple[bytes, ...]:
    """Return the bytes with which HTTP requests begin: a method and a space."""
    return tuple(bytes(next(iter(octet)) for octet in greeting.pattern) for greeting in greetings() if greeting.is_http)
