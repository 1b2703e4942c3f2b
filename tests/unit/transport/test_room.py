"""Who gets a place among many, and whose connection ends for it."""

from __future__ import annotations

from gateway.transport.room import Guest, Room, Use, share
from tests.support.each import each


class Crowd:
    """Connections of a room with eight places, by name; ``gone`` in the order in which they were ended."""

    def __init__(self, most: int = 8) -> None:
        self.room = Room(most)
        self.gone: list[str] = []
        self.guests: dict[str, Guest] = {}

    def comes(self, name: str, host: str, use: Use = Use.IDLE) -> bool:
        guest = self.room.enter(host, lambda: self.gone.append(name), use)
        if guest is not None:
            self.guests[name] = guest
        return guest is not None

    def come(self, host: str, count: int, use: Use = Use.IDLE) -> list[bool]:
        return [self.comes(f"{host}/{number}", host, use) for number in range(count)]


@each(
    ("host", "most", "places"),
    [
        ("10.0.0.1", 64, 48),
        ("10.0.0.1", 400, 300),
        ("10.0.0.1", 2, 2),
        ("10.0.0.1", 1, 1),
        ("::ffff:10.0.0.1", 8, 6),
        ("fe80::1%eth0", 8, 6),
        ("127.0.0.1", 8, 8),
        ("::1", 8, 8),
        ("::ffff:127.0.0.2", 8, 8),
        ("/dev/ttyUSB0", 8, 8),
    ],
)
def test_an_address_may_have_three_quarters_and_this_computer_all(host: str, most: int, places: int) -> None:
    assert share(host, most) == places


def test_an_address_that_has_its_share_ends_its_own_oldest() -> None:
    crowd = Crowd(16)
    crowd.come("10.0.0.2", 1)
    crowd.come("10.0.0.1", 13)
    assert crowd.gone == ["10.0.0.1/0"]
    crowd.room.mark(crowd.guests["10.0.0.1/1"], Use.IDLE)  # it is used: now another one is the oldest
    assert crowd.comes("one more", "10.0.0.1")
    assert crowd.gone == ["10.0.0.1/0", "10.0.0.1/2"]


def test_half_open_ones_go_before_idle_ones_and_what_is_answered_never() -> None:
    crowd = Crowd()
    for number, use in enumerate((Use.ANSWERED, Use.IDLE, Use.HALF_OPEN, Use.HALF_OPEN, Use.IDLE, Use.ANSWERED)):
        crowd.comes(str(number), "10.0.0.1", use)
    assert crowd.come("10.0.0.1", 4) == [True] * 4
    assert crowd.gone == ["2", "3", "1", "4"]
    busy = Crowd()
    assert busy.come("10.0.0.1", 7, Use.ANSWERED) == [True] * 6 + [False]


def test_who_comes_last_takes_a_place_of_the_address_with_most_and_two_are_kept() -> None:
    crowd = Crowd()
    crowd.come("10.0.0.1", 4)
    crowd.come("10.0.0.2", 2)
    assert crowd.comes("more", "10.0.0.2") and crowd.gone == ["10.0.0.1/0"], "six are taken, two are kept"
    assert crowd.comes("stop", "10.0.0.3") and crowd.comes("another stop", "10.0.0.4")
    assert crowd.gone == ["10.0.0.1/0"]
    assert crowd.comes("a third", "10.0.0.5") and crowd.gone == ["10.0.0.1/0", "10.0.0.1/1"]


def test_a_half_open_one_of_an_address_that_has_fewer_stays() -> None:
    crowd = Crowd()
    crowd.come("10.0.0.2", 2, Use.HALF_OPEN)
    crowd.come("10.0.0.1", 4)
    assert crowd.comes("more", "10.0.0.2") and crowd.gone == ["10.0.0.1/0"]


def test_nobody_takes_the_place_of_an_address_that_has_fewer() -> None:
    crowd = Crowd()
    crowd.come("10.0.0.2", 1)
    crowd.come("10.0.0.1", 5, Use.ANSWERED)
    assert not crowd.comes("more", "10.0.0.1") and crowd.gone == []
    assert crowd.comes("stop", "10.0.0.3")


def test_a_place_is_free_again_when_its_guest_has_left() -> None:
    crowd = Crowd()
    crowd.come("127.0.0.1", 6, Use.ANSWERED)
    assert not crowd.comes("more", "127.0.0.1")
    crowd.room.leave(crowd.guests["127.0.0.1/3"])
    assert crowd.comes("more", "127.0.0.1") and crowd.gone == []
