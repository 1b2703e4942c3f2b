"""When Python looks for garbage: seldom while the program starts, and never through what lives as long as it.

What a start makes is modules and tables, hardly any garbage; looking through them again and again took a fifth of the
time to the first answer. Afterwards it is the usual again, for a long look would hold up a stop.
"""

from __future__ import annotations

import gc

#: New objects between two looks, in the three generations: at the start, and Python's own.
AT_START, USUAL = (200_000, 10, 10), (700, 10, 10)


def starting() -> None:
    """The program starts."""
    gc.set_threshold(*AT_START)


def started() -> None:
    """What was made so far lives on. May be called again after more of that kind."""
    gc.freeze()
    gc.set_threshold(*USUAL)
