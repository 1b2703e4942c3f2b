"""A gamepad moves nothing without a finger on a shoulder button, and nothing when it hangs."""

from __future__ import annotations

from typing import Any

import pytest

from tests.unit.console.page.node import ask

CENTRE, UP = (0.0, 0.05), (0.0, -1.0)


def places(speed: float | None, *steps: tuple[float, ...]) -> list[list[str]]:
    """The arrows that are held at each step: milliseconds, the stick, the shoulder button, other buttons."""
    [told] = ask(("stick", speed, steps))
    return [step["places"] for step in told]


def test_gamepad_moves_only_with_shoulder_button_and_after_centring_the_stick() -> None:
    assert places(1.0, (0, *UP, 1), (50, *CENTRE, 1), (100, *UP, 1), (150, *UP, 0), (200, 0.1, -0.14, 1)) == [
        [], [], ["up"], [], [],
    ]  # fmt: skip
    assert places(1.0, (0, *CENTRE, 0), (50, 0.8, -0.9, 1), (99, -0.16, 0.0, 1), (150, 0.1, 0.9, 1)) == [
        [], ["up", "right"], ["left"], ["down"],
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("speed", "still"), [(3.0, 5_000), (0.51, 5_000), (None, 5_000), (0.5, 30_000), (0.01, 30_000)]
)
def test_gamepad_with_frozen_input_moves_nothing(speed: float | None, still: float) -> None:
    steps: list[Any] = [(0, *CENTRE, 0), (50, *UP, 1), (still + 40, *UP, 1), (still + 60, *UP, 1)]
    assert places(speed, *steps) == [[], ["up"], ["up"], []]
    # It must go back to its centre, not only change.
    assert places(speed, *steps, (still + 100, 0.0, -0.9, 1), (still + 150, *CENTRE, 1), (still + 200, *UP, 1))[4:] == [
        [], [], ["up"],
    ]  # fmt: skip


def test_gamepad_user_who_rests_for_a_minute_can_move_again() -> None:
    assert places(3.0, (0, *CENTRE, 0), (60_000, *CENTRE, 0), (60_050, *UP, 1)) == [[], [], ["up"]]


def test_gamepad_stop_button_requires_the_stick_to_be_centred_again() -> None:
    [told] = ask(
        (
            "stick",
            1.0,
            [(0, *CENTRE, 0), (50, *UP, 1), (99, *UP, 1, 1), (150, *UP, 1, 1), (200, *UP, 1), (250, *CENTRE, 1, 12)],
        )
    )
    assert [(step["places"], step["stop"], step["faster"]) for step in told] == [
        ([], False, 0), (["up"], False, 0), ([], True, 0), ([], False, 0), ([], False, 0), ([], False, 1),
    ]  # fmt: skip
