"""Checks the commands sent to a mount against the forms in the two manuals, typed by hand (``conformance/manual``).

Every test with a ``Bridge`` is checked at its end, so that a driver cannot send what only our simulators accept.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache

from tests.support.manual_files import rows


@cache
def _forms(protocol: str) -> re.Pattern[bytes]:
    forms = [row[0].encode("latin-1") for row in rows(f"{protocol}_sent.txt")]
    return re.compile(b"|".join(b"(?:%s)" % form for form in forms), re.DOTALL)


def malformed(protocol: str, sent: Iterable[bytes]) -> list[bytes]:
    """Return the commands among these that have no form in the manual, each once, in order."""
    forms = _forms(protocol)
    return [data for data in dict.fromkeys(sent) if data and not forms.fullmatch(data)]
