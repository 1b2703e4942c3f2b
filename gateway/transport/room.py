"""Limits the number of connections, in total and for each client address.

One address gets at most 3/4 of them, this computer all; but the last two go only to addresses that have none.
"""

from __future__ import annotations

from collections import Counter
from ipaddress import ip_address

from gateway.system.own_names import normalise_address

#: Number of connections reserved for addresses without a connection.
RESERVED_PLACES = 2


class ConnectionQuota:
    """Counts the connections of each address, and admits at most ``capacity`` connections in total."""

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._count_by_address: Counter[str] = Counter()

    def acquire(self, host: str) -> bool:
        """Count one more connection of this host if the limits allow it. Return whether they do."""
        address, free = normalise_address(host), self._capacity - self._count_by_address.total()
        has = self._count_by_address[address]
        if has >= host_capacity(address, self._capacity) or free <= (RESERVED_PLACES if has else 0):
            return False
        self._count_by_address[address] += 1
        return True

    def release(self, host: str) -> None:
        """Count one connection of this host less, because it has closed."""
        self._count_by_address -= Counter([normalise_address(host)])


def host_capacity(host: str, capacity: int) -> int:
    """Return how many of ``capacity`` connections one host may have; this computer or a serial line may have all."""
    try:
        loopback = ip_address(normalise_address(host)).is_loopback
    except ValueError:
        return capacity
    return capacity if loopback else -(-capacity * 3 // 4)
