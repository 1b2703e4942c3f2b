"""Mistyped words: the ones that are most like them.

Needed after a mistake, so the library that compares them is not loaded at every start.
"""

from __future__ import annotations

from collections.abc import Iterable


def alike(word: str, among: Iterable[str], most: int = 1, least: float = 0.6) -> list[str]:
    """``most`` words at most, the nearest first; ``least`` from 0 to 1 is how much alike they must be."""
    from difflib import get_close_matches

    return get_close_matches(word, list(among), most, least)
