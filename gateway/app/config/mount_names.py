"""Names that owners call their mounts: ``6se``, ``CPC 1100``, ``Celestron AVX``, ``lx90``, besides protocol and model.

The names are data: ``called.toml`` of each protocol. They are understood wherever a protocol or a model is written.
A name may leave the model open: ``celestron`` stands for a protocol without a model.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache

from gateway.core.errors import similar
from gateway.protocols.registry import PROTOCOLS
from gateway.protocols.wireformat.command_set import load

#: The row of names that leave the model open.
ANY = "any"


def resolve_name(text: str) -> str | None:
    """Return ``PROTOCOL[:MODEL]`` for a name as a user writes it, without a version; None for an unknown name."""
    head, colon, rest = text.partition(":")
    if not colon:
        return head if head in PROTOCOLS else _look_up(_all_names(), head)
    protocol = head if head in PROTOCOLS else _look_up(_all_names(), head)
    if protocol not in PROTOCOLS:
        return None
    if not rest or rest in load(protocol).models:
        return f"{protocol}:{rest}" if rest else protocol
    own = {word: found for word, found in _all_names().items() if found.startswith(f"{protocol}:")}
    return _look_up(own, rest) or f"{protocol}:{rest}"


def suggest_name(word: str, among: Sequence[str] = tuple(PROTOCOLS)) -> str:
    """Return a hint for an unknown word: the name that is most like it, else the protocol of each maker.

    ``among`` are the protocols that may be meant.
    """
    known = [*among, *(model for protocol in PROTOCOLS for model in load(protocol).models)]
    plain = _normalised(word)
    names = [name for name, found in sorted(_all_names().items()) if found.partition(":")[0] in among]
    for choices in (known, names):
        if close := similar(plain if choices is not known else word, choices, least=0.7):
            return f"did you mean {close[0]!r}?"
    which = ", ".join(
        f"{name} for a {spec.makers[0].title()}" for name, spec in reversed(PROTOCOLS.items()) if spec.makers
    )
    return f"write {which}, or the name of the mount: 6se, cpc, avx, lx90, etx (mount-gateway --help lists the models)"


@cache
def _all_names() -> Mapping[str, str]:
    """Return every name, without blanks and punctuation, with the ``PROTOCOL[:MODEL]`` it stands for."""
    rows = {_normalised(model): f"{protocol}:{model}" for protocol in PROTOCOLS for model in load(protocol).models}
    for protocol in PROTOCOLS:
        for model, words in names_by_model(protocol).items():
            rows |= dict.fromkeys(words, protocol if model == ANY else f"{protocol}:{model}")
    return rows | {protocol: protocol for protocol in PROTOCOLS}


def names_by_model(protocol: str) -> dict[str, Sequence[str]]:
    """Return the names of each model of a protocol. Raises MappingError."""
    return {model: row["words"] for model, row in load(protocol).extra("called.toml").items()}


def _look_up(words: Mapping[str, str], written: str) -> str | None:
    plain = _normalised(written)
    return words.get(plain) or words.get(_makers().sub("", plain))


@cache
def _makers() -> re.Pattern[str]:
    """Return the pattern of a maker or brand that may stand before the name of a mount."""
    specs = PROTOCOLS.values()
    makers = "|".join(maker for spec in specs for maker in spec.makers)
    brands = "|".join(brand for spec in specs for brand in spec.brands)
    return re.compile(f"^(?:{makers})?(?:{brands})?(?=.)")


def _normalised(word: str) -> str:
    return re.sub("[^a-z0-9]", "", word.lower())
