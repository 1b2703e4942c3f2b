"""Settings of Python's garbage collector: it runs rarely during the start, and never examines permanent objects.

A start creates modules and tables and hardly any garbage; repeated collections took a fifth of the time until the first
answer. Afterwards Python's usual thresholds apply, because a long collection would delay a stop.
"""

from __future__ import annotations

import gc

#: The collector's thresholds for its three generations (``gc.set_threshold``): at the start, and Python's defaults.
START_THRESHOLDS, USUAL_THRESHOLDS = (200_000, 10, 10), (700, 10, 10)


def collect_rarely() -> None:
    """Collect garbage rarely from now on, while the program starts."""
    gc.set_threshold(*START_THRESHOLDS)


def exclude_present_objects() -> None:
    """Exclude all present objects from collection, and restore the usual thresholds. May be called again."""
    gc.freeze()
    gc.set_threshold(*USUAL_THRESHOLDS)
