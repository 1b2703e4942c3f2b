"""The rules about the Sun and the altitudes: how their refusals read, and how each can be switched off."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Any
from unittest.mock import patch

from gateway.mount.safety.allow import ALLOWED

#: A word of a refusal or of an end -> the rule behind it. The first that fits counts.
WORDS = {
    "stopped at the altitude": "watch of altitude", "stopped at the Sun": "watch of the Sun",
    "syncs": "if the syncs were wrong", "Too low by": "altitude by other sources",
    "Too high by": "altitude by other sources", "way is too": "way and altitude", "Past the Sun": "way and Sun",
    "way there passes": "way and Sun", "Near the Sun by": "other sources' Suns", "Sun": "goal and Sun",
    "orizon": "goal and altitude", "Limit": "goal and altitude", "time is unknown": "time unknown",
}  # fmt: skip
#: Where the rules of gotos are used.
MOTIONS, WATCH = "gateway.mount.safety.admission.motions", "gateway.mount.safety.allow"


def rule_of(words: str) -> str:
    return next((rule for word, rule in WORDS.items() if word in words), "other")


def _nothing(*_: Any, **__: Any) -> None:
    return None


async def _no_ways(*_: Any, **__: Any) -> bool:
    return False


#: A rule -> the functions that carry it, and what replaces them.
SWITCHES: dict[str, list[tuple[str, Callable[..., Any]]]] = {
    "altitude by other sources": [(f"{MOTIONS}.check_contradictions", _nothing)],
    "if the syncs were wrong": [(f"{MOTIONS}.check_synced", _nothing)],
    "way and altitude": [(f"{MOTIONS}.check_ways", _no_ways)],
    "way and Sun": [(f"{MOTIONS}.clear", lambda *_, **__: True)],
    "watch of altitude": [(f"{WATCH}.altitude", lambda view: ALLOWED)],
    "watch of the Sun": [(f"{WATCH}.near_sun", lambda view: ALLOWED)],
}


@contextlib.contextmanager
def without(rule: str | None) -> Iterator[None]:
    """Switch a rule off meanwhile."""
    with contextlib.ExitStack() as stack:
        for place, instead in SWITCHES[rule] if rule else ():
            stack.enter_context(patch(place, instead))
        yield
