"""Telling systemd how the service is: sd_notify(3), one datagram of ``KEY=VALUE`` lines to ``NOTIFY_SOCKET``.

These few lines are here rather than a library: the pure one there is, ``sdnotify``, has not changed since 2017, waits
for ever on a full queue, which an event loop must not, and does not know the watchdog's interval. systemd's own manual
page prints as much for programs to carry themselves.
"""

from __future__ import annotations

import contextlib
import os
import socket


def wanted() -> bool:
    """Whether anybody wants to be told: a path, or ``@NAME`` for a socket without one."""
    return os.environ.get("NOTIFY_SOCKET", "").startswith(("/", "@"))


def notify(*states: str) -> None:
    """Tell systemd, if it listens; never waits, and raises nothing. A state is ``KEY=VALUE`` on one line."""
    if not wanted():
        return
    address = os.environ["NOTIFY_SOCKET"]
    if address.startswith("@"):
        address = "\0" + address[1:]
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        link.setblocking(False)
        link.sendto("\n".join(states).encode(), address)


def watchdog() -> float | None:
    """The seconds within which ``WATCHDOG=1`` must be heard, sd_watchdog_enabled(3); None where nobody waits."""
    micros, pid = os.environ.get("WATCHDOG_USEC", ""), os.environ.get("WATCHDOG_PID")
    if not wanted() or not micros.isdecimal() or int(micros) == 0 or pid not in (None, str(os.getpid())):
        return None
    return int(micros) / 1e6
