"""What only Linux tells, in ``/proc``, ``/run/udev`` and ``/etc/group``; elsewhere there is nothing to read here.

Whatever cannot be read is not told: another user's processes, a system without udev. The folders are arguments, so that
a test can make its own computer.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Collection, Iterator
from pathlib import Path

from gateway.diagnostics.doctor.facts import Listener

PROC, UDEV = Path("/proc"), Path("/run/udev/data")
#: The state of a TCP socket that listens, as the kernel writes it.
LISTENS = "0A"


def named(names: Collection[str], proc: Path = PROC) -> dict[str, int]:
    """The processes of these names, and their numbers."""
    found = {}
    for process in proc.glob("[0-9]*"):
        with contextlib.suppress(OSError):
            name = (process / "comm").read_text().strip()
            if name in names:
                found[name] = int(process.name)
    return found


def listening(ports: Collection[int], proc: Path = PROC) -> list[Listener]:
    """Who listens on these TCP ports."""
    sockets = {inode: port for inode, port in _sockets(proc) if port in ports}
    owners = dict(_owners(sockets, proc)) if sockets else {}
    return [Listener(port, *owners.get(inode, ())) for inode, port in sockets.items()]


def _sockets(proc: Path) -> Iterator[tuple[str, int]]:
    """Of every socket that listens, its inode and port."""
    for name in ("tcp", "tcp6"):
        with contextlib.suppress(OSError):
            for line in (proc / "net" / name).read_text().splitlines()[1:]:
                words = line.split()
                if len(words) > 9 and words[3] == LISTENS:
                    yield words[9], int(words[1].rpartition(":")[2], 16)


def _owners(inodes: Collection[str], proc: Path) -> Iterator[tuple[str, tuple[int, str]]]:
    """Whose sockets these are, as far as this user may see it."""
    wanted = {f"socket:[{inode}]": inode for inode in inodes}
    for process in proc.glob("[0-9]*"):
        with contextlib.suppress(OSError):
            for file in (process / "fd").iterdir():
                with contextlib.suppress(OSError):
                    if inode := wanted.get(os.readlink(file)):
                        yield inode, (int(process.name), (process / "comm").read_text().strip())


def modem_manager_ignores(device: str, udev: Path = UDEV) -> bool:
    """Whether a udev rule has told ModemManager to leave a port alone."""
    try:
        number = os.stat(device).st_rdev
        told = (udev / f"c{os.major(number)}:{os.minor(number)}").read_text()
    except OSError:
        return False
    return any(line in told.splitlines() for line in ("E:ID_MM_PORT_IGNORE=1", "E:ID_MM_DEVICE_IGNORE=1"))


def groups() -> tuple[set[str], set[str]]:
    """The groups that this user was put into, and those of this session."""
    try:
        import grp
        import pwd
    except ImportError:
        return set(), set()
    every = grp.getgrall()
    active = {group.gr_name for group in every if group.gr_gid in (*os.getgroups(), os.getegid())}
    try:
        user = pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return active, active
    return active | {group.gr_name for group in every if user in group.gr_mem}, active
