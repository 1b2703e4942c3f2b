"""Notifies systemd of the state of the service: sends ``KEY=VALUE`` lines to ``NOTIFY_SOCKET``, as sd_notify(3).

No library does this: the only pure one, ``sdnotify``, has not changed since 2017, blocks on a full queue, which an
event loop must not, and does not report the watchdog's interval. systemd's manual page shows similar code.
"""

from __future__ import annotations

import contextlib
import os
import socket


def expects_notifications() -> bool:
    """Whether systemd expects notifications: ``NOTIFY_SOCKET`` is a path, or ``@NAME`` for an abstract socket."""
    return os.environ.get("NOTIFY_SOCKET", "").startswith(("/", "@"))


def notify(*states: str) -> None:
    """Notify systemd if it listens. Never blocks and never raises. A state is ``KEY=VALUE`` on one line."""
    if not expects_notifications():
        return
    address = os.environ["NOTIFY_SOCKET"]
    if address.startswith("@"):
        address = "\0" + address[1:]
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        link.setblocking(False)
        link.sendto("\n".join(states).encode(), address)


def watchdog_interval() -> float | None:
    """Return the seconds within which ``WATCHDOG=1`` must be sent, sd_watchdog_enabled(3); None if it is off."""
    micros, pid = os.environ.get("WATCHDOG_USEC", ""), os.environ.get("WATCHDOG_PID")
    if not expects_notifications() or not micros.isdecimal() or int(micros) == 0 or pid not in (None, str(os.getpid())):
        return None
    return int(micros) / 1e6
