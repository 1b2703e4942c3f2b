"""The limit of open files, and whether there is room for one more client.

Some open files are reserved for the gateway itself, not for clients: to write the file that marks a moving mount, to
open the mount's port again, and to accept ``mount-gateway stop``.
"""

from __future__ import annotations

import contextlib
import os

try:
    import resource
except ImportError:  # Windows, which has no such limit
    resource = None  # type: ignore[assignment]

#: Numbers of open files: reserved for the gateway; in use by the gateway; in use by each mount and each surface.
RESERVED_FILES, GATEWAY_FILES, FILES_PER_PORT = 16, 24, 6


def open_file_limit() -> int | None:
    """Return how many files this process may have open at a time; None if there is no limit."""
    if resource is None:
        return None
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return None if soft == resource.RLIM_INFINITY else soft


def raise_file_limit(client_count: int, port_count: int) -> str:
    """Raise the limit of open files for these numbers of clients and of ports (mounts and surfaces).
    Return a warning if the system does not allow that many; empty if it does.
    """
    wanted = RESERVED_FILES + GATEWAY_FILES + FILES_PER_PORT * port_count + client_count
    most = open_file_limit()
    if most is None or most >= wanted:
        return ""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    allowed = wanted if hard == resource.RLIM_INFINITY else min(hard, wanted)
    if allowed > soft:
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (allowed, hard))
    most = open_file_limit() or wanted
    if most >= wanted:
        return ""
    return (
        f"this system lets mount-gateway have {most} files open at a time, so no more than about "
        f"{max(0, most - wanted + client_count)} programs can be connected, not the {client_count} of max-clients; "
        f"ulimit -n {wanted} before it is started, or LimitNOFILE={wanted} in its systemd unit, makes room"
    )


def no_room_reason() -> str:
    """Return why no client can connect: only ``RESERVED_FILES`` open files are left. Empty if one can."""
    most = open_file_limit()
    if most is None:
        return ""
    held: list[int] = []
    try:
        for _ in range(RESERVED_FILES):  # some microseconds; the only portable way to find out
            held.append(os.open(os.devnull, os.O_RDONLY))
    except OSError:
        pass
    finally:
        for descriptor in held:
            os.close(descriptor)
    if len(held) == RESERVED_FILES and max(held) < most:
        return ""
    return (
        f"this system lets mount-gateway have {most} files open at a time, and all but {RESERVED_FILES}, which it "
        "needs itself, are open; connect fewer programs, or allow more files: ulimit -n before it is started, "
        "LimitNOFILE= in its systemd unit"
    )
