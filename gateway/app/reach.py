"""Reaching the gateways of this computer: which run, which mounts were left moving, what cannot be known; asking one.

``stop`` may say that there is nothing to stop only after it has looked everywhere: in the state folder, in the runtime
folders, and at the processes of this computer. Whatever it could not see is reported as a doubt, in a whole sentence
that says what can be done about it. A request is repeated until it is answered or the time is up.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Sequence
from pathlib import Path

from msgspec import Struct

from gateway.app.control.exchange import ControlEndpoint, Parts, doors, draw, seal, unseal
from gateway.app.state.file import MarkerContent, read_mark
from gateway.system import processes
from gateway.system.files import directory
from gateway.system.runtime_folders import folders, of_others, user, user_name

#: Seconds from one time that a question is sent to the next: a datagram may be lost.
AGAIN = 0.5
#: Seconds within which a gateway that is well has said that it heard.
HEARD = 3.0


class Found(Struct):
    """``gateways`` can be asked; the gateways that left ``marks`` were killed in motion."""

    gateways: list[tuple[Path, ControlEndpoint]]
    marks: list[MarkerContent]
    doubts: list[str]


class Scope(Struct, frozen=True):
    """A state folder; without ``alone`` also the gateways of this user (root: of all users) that have another one."""

    folder: Path
    alone: bool = False


def scope_of(state: str | None) -> Scope:
    """The folder that somebody has named, or systemd, and no other then; else the usual one of this user."""
    return Scope(directory(state), alone=bool(state or os.environ.get("STATE_DIRECTORY")))


def unseen(scope: Scope) -> list[processes.Process]:
    """The gateways among the processes that cannot be asked, and may be meant."""
    if scope.alone and _sure_of(scope.folder):
        return []
    known = {door.pid for _, door in _all_doors(scope.folder)[0]}
    return [process for process in processes.gateways() if process.pid not in known]


def reachable(process: processes.Process) -> bool:
    """Whether this user should be able to ask a gateway, once it is ready for that."""
    return user() in (0, process.user)


def look(scope: Scope) -> Found:
    """Look into every folder. Nothing is sent to anybody."""
    seen, doubts = _all_doors(scope.folder)
    here = os.path.realpath(scope.folder)
    gateways: dict[tuple[int, int], tuple[Path, ControlEndpoint]] = {}
    for path, door in seen:
        if not scope.alone or path.parent == scope.folder or os.path.realpath(door.state) == here:
            gateways.setdefault((door.pid, door.port), (path, door))
    marks = [mark for mark in map(read_mark, sorted(scope.folder.glob("*.moving"))) if mark is not None]
    return Found(list(gateways.values()), marks, doubts)


def _all_doors(folder: Path) -> tuple[list[tuple[Path, ControlEndpoint]], list[str]]:
    """Of every gateway that this user may ask, and what could not be looked into."""
    found: list[tuple[Path, ControlEndpoint]] = []
    doubts = []
    try:
        found += doors(folder)
    except FileNotFoundError:
        pass
    except OSError as error:
        doubts.append(
            f"{folder}: {error.strerror}: whether a gateway of that folder runs, or was killed in motion, "
            "cannot be seen; stop as the user that the gateway runs as"
        )
    for own in folders()[0]:
        found += _readable(own, user())
    for other, owner in of_others():
        found += _readable(other, owner)
    return found, doubts


def _readable(folder: Path, owner: int | None) -> Sequence[tuple[Path, ControlEndpoint]]:
    try:
        return doors(folder, owner)
    except OSError:
        return []


def _sure_of(folder: Path) -> bool:
    """Whether a gateway with this state folder would have left its endpoint there, for this user to see.

    The folder is this user's (to root all are), and takes files.
    """
    try:
        if os.name != "posix":
            return os.access(folder, os.W_OK)
        room = os.statvfs(folder)
        mine = user() in (0, os.lstat(folder).st_uid)
        return mine and os.access(folder, os.W_OK) and room.f_bavail > 0 and (room.f_files == 0 or room.f_favail > 0)
    except OSError:
        return False


def doubt(process: processes.Process) -> str:
    """A gateway that cannot be asked, in words."""
    if reachable(process):
        return (
            f"a gateway runs as process {process.pid} and cannot be asked: it is of an older version, or had no "
            f"folder to write to; kill {process.pid} ends it, which stops its mount"
        )
    whose = user_name(process.user)
    return f"a gateway of {whose} runs as process {process.pid}: stop it as {whose}, or as root"


class _Asking(asyncio.DatagramProtocol):
    """``done`` is the answer, or what the system said; ``heard`` whether anything came from the gateway."""

    def __init__(self, secret: str, number: str) -> None:
        self._secret, self._number, self._parts = secret, number, Parts()
        self.heard = False
        self.done: asyncio.Future[str] = asyncio.get_running_loop().create_future()

    def datagram_received(self, data: bytes, addr: object) -> None:
        """A part of the answer, or noise."""
        found = unseal(self._secret, data)
        if found is not None and found[0] == self._number:
            self.heard = True
            answer = self._parts.add(found[1])
            if answer is not None and not self.done.done():
                self.done.set_result(answer)

    def error_received(self, exc: Exception) -> None:
        """Nobody has that port."""
        if not self.done.done():
            self.done.set_exception(exc)


def silent(pid: int) -> str:
    """What a gateway that does not answer may be, and what to do about it."""
    ended = f"end it with kill -9 {pid}, then mount-gateway stop stops its mount without it"
    goes_on = f"it is suspended (Ctrl-Z?), and kill -CONT {pid} lets it go on; or " if processes.suspended(pid) else ""
    return f"the gateway (process {pid}) does not answer: {goes_on}{ended}"


async def ask(door: ControlEndpoint, word: str, seconds: float) -> str | None:
    """-> the gateway's answer, or ``failed REASON``; None where no gateway is at this endpoint any more."""
    number = draw()
    loop = asyncio.get_running_loop()
    try:
        transport, asking = await loop.create_datagram_endpoint(
            lambda: _Asking(door.secret, number), remote_addr=("127.0.0.1", door.port)
        )
    except (OSError, OverflowError) as error:
        return f"failed the gateway (process {door.pid}) cannot be reached: {error}"
    try:
        async with asyncio.timeout(seconds):
            silence = loop.time() + HEARD
            while not asking.done.done():
                if not asking.heard and loop.time() > silence:
                    raise TimeoutError
                transport.sendto(seal(door.secret, number, f"ask {word}"))
                await asyncio.wait({asking.done}, timeout=AGAIN)
        return asking.done.result()
    except ConnectionError:
        return f"failed {silent(door.pid)}" if processes.is_gateway(door.pid) else None
    except (OSError, TimeoutError):
        return f"failed {silent(door.pid)}" if processes.exists(door.pid) else None
    finally:
        transport.close()
