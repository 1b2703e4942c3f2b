"""How a key of ``gateway.toml`` is declared: its words, what its value is called, an example, its limits."""

from __future__ import annotations

from typing import Annotated, Any

from msgspec import Meta

#: What is written where something is not wanted at all.
OFF = "off"


def key(words: str, shown: str = "", example: Any = None, *, flag: bool = True, **limits: Any) -> Meta:
    return Meta(description=words, extra={"shown": shown, "example": example, "flag": flag}, **limits)


#: What a name may be made of: no blank, no slash, no wildcard.
WORD = r"[A-Za-z0-9_.-]+"
Word = Annotated[str, Meta(pattern=f"^{WORD}$", title="a word of letters, digits and _ . -")]
Plain = Annotated[str, Meta(pattern=r"^[ -\"$-~]+$", title="plain text without #")]
