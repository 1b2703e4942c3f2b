"""How many random examples a property is tried with: a third of hypothesis's hundred, and all of them in a whole run.

They are others in every run, so that what one run does not meet another one does.
"""

from __future__ import annotations

from hypothesis import settings

from tests.support.sampling import as_a_rule

#: Stands above or below ``given``.
some = settings(max_examples=as_a_rule(33, whole=100))
