"""The gateways among the processes of this computer, as far as the system tells: on Linux, by ``/proc``.

What is seen here cannot be reached by it; it is how somebody learns that there is a gateway which he does not reach,
and whose it is.
"""

from __future__ import annotations

import os
from pathlib import Path

from msgspec import Struct

PROC = Path("/proc")
#: The commands that serve mounts.
SERVING = ("run", "demo")


class Process(Struct, frozen=True):
    """A gateway: its number, and the number of the user that it runs as."""

    pid: int
    user: int


def gateways() -> list[Process]:
    """All that can be seen, but for this process; none where the system does not tell."""
    found = []
    for entry in PROC.iterdir() if PROC.is_dir() else ():
        if entry.name.isdecimal() and int(entry.name) != os.getpid() and serves(_words(int(entry.name))):
            try:
                found.append(Process(int(entry.name), entry.stat().st_uid))
            except OSError:
                continue  # it has just ended
    return sorted(found, key=lambda process: process.pid)


def is_gateway(pid: int) -> bool:
    """Whether a process is known to be a gateway; where the system tells no more, whether there is such a process."""
    if PROC.joinpath(str(os.getpid())).is_dir():
        return pid == os.getpid() or serves(_words(pid))
    return os.name == "posix" and exists(pid)


def exists(pid: int) -> bool:
    """Whether there is such a process, or may be: Windows has no signal that does no harm."""
    if os.name != "posix":
        return True
    try:
        os.kill(pid, 0)
    except PermissionError:
        return True
    except (OSError, OverflowError):
        return False
    return True


def suspended(pid: int) -> bool:
    """Whether a process was stopped, by Ctrl-Z for example; False where the system does not tell."""
    try:
        state = PROC.joinpath(str(pid), "stat").read_bytes().rpartition(b")")[2].split()[:1]
    except OSError:
        return False
    return state in ([b"T"], [b"t"])


def _words(pid: int) -> list[str]:
    """The command line of a process; none for one that is gone, or that the system hides."""
    try:
        return PROC.joinpath(str(pid), "cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return []


def serves(words: list[str]) -> bool:
    """Whether a command line is one of a gateway: the program, by whichever name, and a command that serves."""
    first = os.path.basename(words[0]) if words else ""
    if first != "mount-gateway" and not first.startswith(("python", "pypy")):
        return False
    for index, word in enumerate(words[:-1]):
        module = index > 0 and words[index - 1 : index + 1] == ["-m", "gateway"]
        if module or os.path.basename(word) == "mount-gateway" or word.endswith("gateway/__main__.py"):
            return words[index + 1] in SERVING
    return False
