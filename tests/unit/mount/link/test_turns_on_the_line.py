"""Whose turn it is on the line: values in, an order out, no loop."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from gateway.mount.link.queue import (
    AGING_TIMES,
    MAX_MOTIONS_IN_A_ROW,
    MAX_START_DELAY,
    MOTION,
    POSITION,
    READ,
    SETTING,
    STOP,
    hold_back_time,
    is_too_late,
    sort_queue,
)
from gateway.protocols.base.driver import Send
from tests.support.each import each

NOW = 100.0


class Waits(NamedTuple):
    priority: int
    number: int = 0
    queued_at: float = NOW
    command: Send = Send("e")


def priorities(*waiting: Waits, motions: int = 0, passed_over: int = 0) -> list[int]:
    return [one.priority for one in sort_queue(waiting, NOW, motions, passed_over)]


@each("priority", [POSITION, READ])
def test_long_waiting_read_precedes_settings_and_is_not_starved_by_motions(priority: int) -> None:
    aged = Waits(priority, 1, NOW - AGING_TIMES[priority] - 0.01)
    assert priorities(Waits(SETTING), aged) == [priority, SETTING]
    assert priorities(Waits(MOTION), aged) == [MOTION, priority]
    assert priorities(Waits(MOTION), aged, motions=MAX_MOTIONS_IN_A_ROW) == [priority, MOTION]
    assert priorities(Waits(STOP), aged, motions=MAX_MOTIONS_IN_A_ROW) == [STOP, priority]


def test_read_waits_if_a_more_urgent_order_is_about_to_come() -> None:
    assert hold_back_time(Waits(READ), NOW, NOW + 0.1, typical_rtt=0.1) == pytest.approx(0.15)
    assert hold_back_time(Waits(READ), NOW, NOW + 0.2, typical_rtt=0.1) is None
    assert hold_back_time(Waits(READ), NOW, None, typical_rtt=0.1) is None
    assert hold_back_time(Waits(MOTION), NOW, NOW + 0.1, typical_rtt=0.1) is None


def test_overdue_arrow_command_is_not_sent_to_mount() -> None:
    arrow = Send("move", at_once_or_never=True)
    assert is_too_late(Waits(MOTION, queued_at=NOW - MAX_START_DELAY - 0.01, command=arrow), NOW)
    assert not is_too_late(Waits(MOTION, queued_at=NOW - MAX_START_DELAY + 0.01, command=arrow), NOW)
    assert not is_too_late(Waits(MOTION, queued_at=NOW - MAX_START_DELAY - 0.01), NOW)
