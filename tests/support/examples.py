"""How many random examples hypothesis tries: a third of its default of 100, or all 100 with ``pytest --whole``.

The examples are different in every run, so that the runs together cover more.
"""

from __future__ import annotations

from hypothesis import settings

from tests.support.sampling import as_a_rule

#: A decorator, to be used with ``given``.
some = settings(max_examples=as_a_rule(33, whole=100))
