"""Limits the number of connections, in total and per address that they come from.

One address gets at most three quarters of them, this computer all. The last are for addresses without a connection.
"""

from __future__ import annotations

from collections import Counter
from ipaddress import ip_address

from gateway.system.own_names import plain_address

#: Number of places reserved for addresses without a connection.
RESERVED_PLACES = 2


class Room:
    """A limited number of connections: ``capacity`` places."""

    def __init__(self, capacity: int) -> None:
        self._most = capacity
        self._taken: Counter[str] = Counter()

    def enter(self, host: str) -> bool:
        """Take a place for this host, and return whether any was free."""
        address, free = plain_address(host), self._most - self._taken.total()
        has = self._taken[address]
        if has >= share(address, self._most) or free <= (RESERVED_PLACES if has else 0):
            return False
        self._taken[address] += 1
        return True

    def leave(self, host: str) -> None:
        """Give a place back."""
        self._taken -= Counter([plain_address(host)])


def share(host: str, capacity: int) -> int:
    """Return how many of ``capacity`` places one host may have; this computer and a serial line may have all."""
    try:
        loopback = ip_address(plain_address(host)).is_loopback
    except ValueError:
        return capacity
    return capacity if loopback else -(-capacity * 3 // 4)
