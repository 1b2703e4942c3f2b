"""Room for a limited number of connections, shared among the addresses that they come from.

One address gets at most three quarters of the places, this computer all. If there is no place left for a newcomer, the
address with the most loses one: its oldest half-open connection, else the one that was not used for longest. What is
being answered never goes. The last places are for an address that has none, so that a stop gets in.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from enum import IntEnum
from ipaddress import ip_address

from gateway.system.own_names import plain_address

#: Places for an address that has none.
KEPT = 2


class Use(IntEnum):
    """What a connection is doing, in the order in which they go: its request is not whole, nothing, it is answered."""

    HALF_OPEN = 0
    IDLE = 1
    ANSWERED = 2


class Guest:
    """A connection that has a place. ``end`` closes it."""

    def __init__(self, address: str, end: Callable[[], object], use: Use) -> None:
        self.address, self.end, self.use = address, end, use


class Room:
    """``most`` places."""

    def __init__(self, most: int) -> None:
        self._most = most
        #: In the order in which their use changed.
        self._guests: dict[Guest, None] = {}

    def enter(self, host: str, end: Callable[[], object], use: Use = Use.HALF_OPEN) -> Guest | None:
        """Give a newcomer a place, for which another connection may be closed; None if there is none."""
        guest = Guest(plain_address(host), end, use)
        if not self._make_place(guest.address):
            return None
        self._guests[guest] = None
        return guest

    def mark(self, guest: Guest, use: Use) -> None:
        """Say what a connection does from now on."""
        guest.use = use
        if guest in self._guests:
            self.leave(guest)
            self._guests[guest] = None

    def leave(self, guest: Guest) -> None:
        self._guests.pop(guest, None)

    def _make_place(self, address: str) -> bool:
        """Return whether there is a place for one more of this address; close another connection if need be."""
        counts = Counter(guest.address for guest in self._guests)
        known, among = address in counts, list(self._guests)
        counts[address] += 1
        if counts[address] > share(address, self._most):
            among = [guest for guest in among if guest.address == address]
        elif len(among) < self._most - KEPT * known:
            return True
        among = [one for one in among if one.use is not Use.ANSWERED and counts[one.address] >= counts[address]]
        if not among:
            return False
        victim = min(among, key=lambda guest: (-counts[guest.address], guest.use))
        self.leave(victim)
        victim.end()
        return True


def share(host: str, most: int) -> int:
    """Return how many of ``most`` places one host may have: this computer and a serial line all."""
    try:
        loopback = ip_address(plain_address(host)).is_loopback
    except ValueError:
        return most
    return most if loopback else -(-most * 3 // 4)
