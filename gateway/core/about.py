"""The version of this program, its date, and the folder of its package."""

from __future__ import annotations

from pathlib import Path

VERSION = "0.1.0"
#: Unix seconds, 2026-01-01: it is later than that wherever this version runs.
RELEASED = 1767225600.0
#: The folder ``gateway/``, in a checkout or as installed.
PACKAGE = Path(__file__).resolve().parents[1]
#: The rules by which the gateway decides. A recording is replayed by those of its time: by the first ones a site or
#: clock might go to a mount that slews, and a goto did not wait for them.
RULES, FIRST_RULES = 2, 1
