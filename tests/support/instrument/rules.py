"""The rules about the Sun and the altitudes: how their refusals read, and how each can be switched off."""

from __future__ import annotations

#: A word of a refusal or of an end -> the rule behind it. The first that fits counts.
WORDS = {
    "stopped at the altitude": "watch of altitude", "stopped at the Sun": "watch of the Sun",
    "syncs": "if the syncs were wrong", "Too low by": "altitude by other sources",
    "Too high by": "altitude by other sources", "way is too": "way and altitude", "Past the Sun": "way and Sun",
    "way there passes": "way and Sun", "Near the Sun by": "other sources' Suns", "Sun": "goal and Sun",
    "orizon": "goal and altitude", "Limit": "goal and altitude", "time is unknown": "time unknown",
}  # fmt: skip


def rule_of(words: str) -> str:
    return next((rule for word, rule in WORDS.items() if word in words), "other")
