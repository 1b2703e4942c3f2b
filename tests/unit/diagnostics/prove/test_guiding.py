"""Guide rates are judged by what the steps of a reading and the time of an exchange can show."""

from __future__ import annotations

import pytest

from gateway.diagnostics.prove.findings import DIFFERS, NOT_MEASURABLE, SAME
from gateway.diagnostics.prove.guiding import guide_rate_finding

#: Degrees in a second of arc.
SECOND = 1.0 / 3600.0


@pytest.mark.parametrize(
    ("measured", "verdict", "words"),
    [
        (8.2, SAME, '8.2"/s ± 1.3"/s'),
        (9.6, NOT_MEASURABLE, '9.6"/s ± 1.3"/s, too rough to judge'),
        (5.4, NOT_MEASURABLE, '5.4"/s ± 1.3"/s, too rough to judge'),
        (12.0, DIFFERS, '12.0"/s ± 1.3"/s'),
        (-7.5, DIFFERS, 'reversed, 7.5"/s ± 1.3"/s'),
    ],
)
def test_guide_rate_off_by_more_than_a_quarter_counts_as_different(measured: float, verdict: str, words: str) -> None:
    """An exchange of 60 ms is 15 % of a pulse, 1.1"/s of 7.5"/s; two steps of 0.3" in 4 s are 0.15"/s."""
    finding = guide_rate_finding("guiding west/east", measured * SECOND, 7.5 * SECOND, 0.06, 0.3 * SECOND)
    assert (finding.verdict, finding.measured, finding.assumed) == (verdict, words, '7.5"/s')


def test_guide_motion_of_few_reading_steps_is_not_judged() -> None:
    finding = guide_rate_finding("guiding west/east", 7.5 * SECOND, 7.5 * SECOND, 0.06, 20.0 * SECOND)
    assert (finding.verdict, finding.measured) == (NOT_MEASURABLE, "too few steps of its reading")
