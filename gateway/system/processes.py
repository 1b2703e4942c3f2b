"""Finds the running gateways, and the processes that listen on TCP ports, from Linux's ``/proc``.

A gateway that is found only in this way cannot be controlled; the gateway's commands show just that it runs, and as
which user. The open files and ports of other users' processes are hidden.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Collection, Iterator
from pathlib import Path

from msgspec import Struct

PROC_FOLDER = Path("/proc")
#: The subcommands of mount-gateway that serve mounts.
SERVING_COMMANDS = ("run", "demo")
#: The state of a listening TCP socket in the kernel's table.
LISTEN_STATE = "0A"


class GatewayProcess(Struct, frozen=True):
    """A running gateway: its process id, and the id of its user."""

    pid: int
    user_id: int


def gateways() -> list[GatewayProcess]:
    """Return all gateways that are visible, except this process; none on systems without ``/proc``."""
    running = []
    for entry in PROC_FOLDER.iterdir() if PROC_FOLDER.is_dir() else ():
        if entry.name.isdecimal() and int(entry.name) != os.getpid() and is_gateway_argv(_argv(int(entry.name))):
            try:
                running.append(GatewayProcess(int(entry.name), entry.stat().st_uid))
            except OSError:
                continue  # it has ended meanwhile
    return sorted(running, key=lambda process: process.pid)


def is_gateway(pid: int) -> bool:
    """Whether a process is a gateway; without ``/proc``, whether it exists; always False on Windows."""
    if PROC_FOLDER.joinpath(str(os.getpid())).is_dir():
        return pid == os.getpid() or is_gateway_argv(_argv(pid))
    return os.name == "posix" and exists(pid)


def exists(pid: int) -> bool:
    """Whether a process exists; always True on Windows, which has no harmless signal to find out."""
    if os.name != "posix":
        return True
    try:
        os.kill(pid, 0)
    except PermissionError:
        return True
    except (OSError, OverflowError):
        return False
    return True


def is_suspended(pid: int) -> bool:
    """Whether a process is suspended, by Ctrl-Z for example; False if unknown."""
    try:
        state = PROC_FOLDER.joinpath(str(pid), "stat").read_bytes().rpartition(b")")[2].split()[:1]
    except OSError:
        return False
    return state in ([b"T"], [b"t"])


def age(pid: int) -> float:
    """Return for how many seconds a process has run; 0 if unknown."""
    try:
        ticks = int(PROC_FOLDER.joinpath(str(pid), "stat").read_bytes().rpartition(b")")[2].split()[19])
        return float((PROC_FOLDER / "uptime").read_text().split()[0]) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return 0.0


def _argv(pid: int) -> list[str]:
    """Return the command line of a process; empty if it has ended or is hidden."""
    try:
        return PROC_FOLDER.joinpath(str(pid), "cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return []


def is_gateway_argv(argv: list[str]) -> bool:
    """Whether a command line starts a gateway: any name of the program, then a subcommand that serves mounts."""
    first = os.path.basename(argv[0]) if argv else ""
    if first != "mount-gateway" and not first.startswith(("python", "pypy")):
        return False
    for index, argument in enumerate(argv[:-1]):
        module = index > 0 and argv[index - 1 : index + 1] == ["-m", "gateway"]
        if module or os.path.basename(argument) == "mount-gateway" or argument.endswith("gateway/__main__.py"):
            return argv[index + 1] in SERVING_COMMANDS
    return False


def listeners_on(ports: Collection[int], proc: Path = PROC_FOLDER) -> Iterator[tuple[int, tuple[()] | tuple[int, str]]]:
    """Yield each of these TCP ports that a process listens on, with its process's (id, name), () if that is hidden."""
    sockets = {inode: port for inode, port in _listen_sockets(proc) if port in ports}
    owners = dict(holders_of([f"socket:[{inode}]" for inode in sockets], proc)) if sockets else {}
    for inode, port in sockets.items():
        yield port, owners.get(f"socket:[{inode}]", ())


def _listen_sockets(proc_folder: Path) -> Iterator[tuple[str, int]]:
    """Yield the inode and the port of every listening socket."""
    for name in ("tcp", "tcp6"):
        with contextlib.suppress(OSError):
            for line in (proc_folder / "net" / name).read_text().splitlines()[1:]:
                columns = line.split()
                if len(columns) > 9 and columns[3] == LISTEN_STATE:
                    yield columns[9], int(columns[1].rpartition(":")[2], 16)


def holders_of(targets: Collection[str], proc_folder: Path = PROC_FOLDER) -> Iterator[tuple[str, tuple[int, str]]]:
    """Yield each of these files or sockets with the id and name of every visible process that has it open."""
    for process in proc_folder.glob("[0-9]*"):
        with contextlib.suppress(OSError):
            for file in (process / "fd").iterdir():
                with contextlib.suppress(OSError):
                    if (target := os.readlink(file)) in targets:
                        yield target, (int(process.name), (process / "comm").read_text().strip())
