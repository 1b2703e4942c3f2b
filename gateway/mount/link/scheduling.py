"""Whose turn it is on the line to the mount: pure functions over what waits.

A stop goes first, then motion, then the position, then settings, then other reads; what has waited long rises in rank.
A read that would delay something urgent waits for that.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol, TypeVar

from gateway.protocols.base.driver import Send

STOP, MOTION, POSITION, WAITED, SETTING, READ = range(6)
READS = (POSITION, READ)
#: What begins a motion by hand is refused when it could not be sent within so many seconds: whoever pressed the key has
#: let it go by then, or pressed another.
AT_ONCE = 2.0
#: What is said of it.
LATE = "The line to the mount was busy for too long: this motion is not begun any more."
#: Seconds after which a read has WAITED and goes before settings: clients that set without end must not blind the
#: gateway. The position always does, and before other reads: its halves must be of one instant.
AGED: Mapping[int, float] = {POSITION: 0.25, READ: 0.6, SETTING: 2.0}
#: After so many exchanges for motions in a row one such read goes first: no flood of arrows may hide the mount.
IN_A_ROW = 1
#: After so many exchanges for others an aged setting goes first: reads of a mount that is slow or asleep never end.
PASSED_OVER = 4
#: Something urgent is waited for that is due within so many times what an exchange takes, and this many seconds longer.
BEFORE_URGENT, AFTER_DUE = 1.5, 0.05


class Waiting(Protocol):
    """An exchange that waits: its place in the order of coming, when it was asked for, whether it had its turn once."""

    @property
    def ask(self) -> Send: ...
    @property
    def rank(self) -> int: ...
    @property
    def number(self) -> int: ...
    @property
    def asked(self) -> float: ...
    @property
    def chosen(self) -> bool: ...


W = TypeVar("W", bound=Waiting)


def in_turn(waiting: Iterable[W], now: float, motions: int, passed_over: int) -> list[W]:
    """Whatever waits, in the order in which its turn comes.

    ``motions`` is how many exchanges in a row were for motions, ``passed_over`` how many since the last setting.
    """
    before_all = STOP + 0.5
    waited = before_all if motions >= IN_A_ROW else WAITED
    risen = {POSITION: waited, READ: waited, SETTING: before_all if passed_over >= PASSED_OVER else SETTING}

    def turn(one: W) -> tuple[float, int, int]:
        if one.chosen and one.rank in READS:
            return POSITION - 0.5, one.rank, one.number
        aged = now - one.asked > AGED.get(one.rank, 1e9)
        return min(one.rank, risen[one.rank]) if aged else one.rank, one.rank, one.number

    return sorted(waiting, key=turn)


def held_back(first: Waiting, now: float, urgent: float | None, typical: float) -> float | None:
    """Seconds for which a read waits for something ``urgent`` that is due then; None when it need not.

    ``typical`` is how long an exchange takes.
    """
    if urgent is None or first.rank not in READS or urgent - now >= BEFORE_URGENT * typical:
        return None
    return max(0.0, urgent - now) + AFTER_DUE


def too_late(one: Waiting, now: float) -> bool:
    """Whether it begins a motion by hand that is no longer meant."""
    return one.ask.prompt and now - one.asked > AT_ONCE
