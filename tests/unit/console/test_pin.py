"""The console's PIN cannot be tried out, and its rightful user is not shut out by those who try."""

from __future__ import annotations

import pytest

from gateway.console.pin import FREE_TRIES, TOTAL_FREE_TRIES, TRY_PERIOD, Pin
from gateway.core.errors import UserError

HERE, THERE = "192.168.1.20", "192.168.1.66"


class Tried:
    def __init__(self) -> None:
        self.now, self.log = 1000.0, list[str]()
        self.pin = Pin("4711", lambda: self.now, self.log.append)

    def outcome(self, pin: str, host: str = THERE) -> bool | str:
        try:
            return self.pin.admits(pin, host)
        except UserError as error:
            return str(error)


@pytest.fixture
def tried() -> Tried:
    return Tried()


def test_pin_allows_an_address_five_tries_then_one_a_minute(tried: Tried) -> None:
    assert [tried.outcome("0000") for _ in range(FREE_TRIES)] == [False] * FREE_TRIES
    assert "wait 60 s" in str(tried.outcome("4711")), "a try that has to wait is not even compared"
    tried.now += TRY_PERIOD
    assert tried.outcome("0000") is False
    tried.now += TRY_PERIOD - 1
    assert "wait 1 s" in str(tried.outcome("4711"))
    tried.now += 1
    assert tried.outcome("4711") is True
    assert tried.outcome("0000") is False, "the right one gives the free tries back"


def test_pin_allows_many_addresses_together_ten_tries_a_minute(tried: Tried) -> None:
    compared = 0
    for second in range(3600):
        tried.now = 1000.0 + second
        compared += sum(tried.outcome("0000", f"10.0.{second % 200}.{one}") is False for one in range(20))
    assert compared == TOTAL_FREE_TRIES * 60


def test_pin_tries_of_others_do_not_delay_a_known_address(tried: Tried) -> None:
    assert tried.outcome("4711", HERE) is True
    for one in range(50):
        tried.outcome("0000", f"10.0.0.{one}")
    assert isinstance(tried.outcome("4711", "192.168.1.21"), str)
    assert tried.outcome("4711", HERE) is True


def test_pin_check_without_a_pin_admits_nobody() -> None:
    assert not Pin("", lambda: 0.0, [].append).admits("", HERE)
