"""The console's PIN, and limits on the number of wrong tries.

An address has five wrong tries, then one a minute. All addresses together have ten wrong tries a minute; an address
that has given the right PIN before is exempt from this second limit. A try above a limit is refused without comparing
the PIN, so that the refusal reveals nothing. Stopping and reading need no PIN.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import ceil

from gateway.app.pages import is_same_token
from gateway.core.errors import UserError

#: How many wrong tries an address has before it must wait; seconds that it then waits between two tries.
FREE_TRIES, TRY_PERIOD = 5, 60.0
#: The maximum number of wrong tries of all addresses together within ``TRY_PERIOD`` seconds.
TOTAL_FREE_TRIES = 10
#: The maximum number of addresses that are remembered.
MAX_HOSTS = 1000


class Pin:
    """The right PIN; empty if there is none. ``monotonic_time`` returns monotonic seconds, ``warn`` logs a line."""

    def __init__(self, pin: str, monotonic_time: Callable[[], float], warn: Callable[[str], None]) -> None:
        self._pin, self._monotonic_time, self._warn = pin, monotonic_time, warn
        #: Address -> number and last time of wrong tries; addresses that gave the right PIN; times of wrong tries.
        self._wrong_tries: dict[str, tuple[int, float]] = {}
        self._trusted_hosts: set[str] = set()
        self._wrong_try_times: deque[float] = deque(maxlen=TOTAL_FREE_TRIES)

    def __bool__(self) -> bool:
        return bool(self._pin)

    def admits(self, pin: str, host: str) -> bool:
        """Whether this is the right PIN. Raises UserError while the address has to wait."""
        now = self._monotonic_time()
        if (wait := ceil(self._next_try_at(host) - now)) > 0:
            raise UserError(f"too many wrong pins: wait {wait} s, then try again; looking and STOP need no pin")
        if bool(self._pin) and is_same_token(pin, self._pin):
            self._wrong_tries.pop(host, None)
            if len(self._trusted_hosts) < MAX_HOSTS:
                self._trusted_hosts.add(host)
            return True
        count = self._wrong_tries.pop(host, (0, 0.0))[0] + 1
        self._wrong_tries[host] = (count, now)
        if len(self._wrong_tries) > MAX_HOSTS:
            del self._wrong_tries[next(iter(self._wrong_tries))]
        if host not in self._trusted_hosts:
            self._wrong_try_times.append(now)
        self._warn(f"wrong pin from {host} ({count} since the last right one)")
        return False

    def _next_try_at(self, host: str) -> float:
        """Return the monotonic time from which this address may try."""
        count, last = self._wrong_tries.get(host, (0, 0.0))
        allowed_at = last + TRY_PERIOD if count >= FREE_TRIES else 0.0
        if host in self._trusted_hosts or len(self._wrong_try_times) < TOTAL_FREE_TRIES:
            return allowed_at
        return max(allowed_at, self._wrong_try_times[0] + TRY_PERIOD)
