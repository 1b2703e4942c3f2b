"""Finds the gateways of this computer and the mounts that killed gateways left moving, and sends requests to gateways.

``stop`` may report that there is nothing to stop only after a search of the state folder, the runtime folders and the
processes of this computer. For everything that the search could not read it reports a warning that says what the user
can do about it. A request is sent again until it is answered or times out.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import msgspec
from msgspec import Struct

from gateway.app.control import exchange
from gateway.app.control.exchange import ControlEndpoint, motion_markers
from gateway.app.state.file import MarkerContent, read_marker
from gateway.app.status import State
from gateway.core.errors import NoAnswer
from gateway.core.requests import FAILED, Answer, Request, StateRequest, encode, new_request_number
from gateway.system import processes
from gateway.system.files import state_folder
from gateway.system.runtime_folders import find_folders, folders_of_others, user_id, user_name

#: Seconds until a request is sent again: a datagram may be lost.
RESEND_PERIOD = 0.5
#: Seconds within which a healthy gateway has confirmed that it received the request.
RECEIPT_TIMEOUT = 3.0
#: Timeout in seconds for the answer to a request, in addition to the duration of a ``MoveRequest``.
ANSWER_TIMEOUT = 15.0


class SearchResult(Struct):
    """Reachable gateways; files that say that a mount may move, by state folder; warnings of what was not searched."""

    gateways: list[tuple[Path, ControlEndpoint]]
    markers: list[tuple[Path, MarkerContent]]
    warnings: list[str]


class Scope(Struct, frozen=True):
    """Where to search: only one state folder, or also all gateways of this user (root: of all users)."""

    folder: Path
    folder_only: bool = False


def scope_of(folder: str | None) -> Scope:
    """Return the scope of a state folder named by ``--state`` or systemd, else of this user's default folder."""
    return Scope(state_folder(folder), folder_only=bool(folder or os.environ.get("STATE_DIRECTORY")))


def unreachable_gateways(scope: Scope) -> list[processes.GatewayProcess]:
    """Return the gateway processes that belong or may belong to the scope, but have no readable endpoint file."""
    if scope.folder_only and _must_hold_endpoint(scope.folder):
        return []
    known = {endpoint.pid for _, endpoint in _all_endpoints(scope.folder)[0]}
    return [process for process in processes.gateways() if process.pid not in known]


def may_reach(process: processes.GatewayProcess) -> bool:
    """Whether this user has the right to send requests to a gateway, once its control endpoint is open."""
    return user_id() in (0, process.user_id)


def search(scope: Scope) -> SearchResult:
    """Search the folders of the scope; this sends nothing to any gateway.

    It looks for motion markers in the state folder of the scope and in those of this user's gateways. Markers of
    another user's gateways do not count: root would open whatever port such a file names.
    """
    endpoints, doubts = _all_endpoints(scope.folder)
    folder = os.path.realpath(scope.folder)
    gateways: dict[tuple[int, int], tuple[Path, ControlEndpoint]] = {}
    for path, endpoint in endpoints:
        if not scope.folder_only or path.parent == scope.folder or os.path.realpath(endpoint.state) == folder:
            gateways.setdefault((endpoint.pid, endpoint.port), (path, endpoint))
    of_gateways = (motion_markers(endpoint) for path, endpoint in gateways.values() if belongs_to_user(path.parent))
    paths = {os.path.realpath(path): path for path in chain(scope.folder.glob("*.moving"), *of_gateways)}
    markers = [(path.parent, mark) for path in sorted(paths.values()) if (mark := read_marker(path)) is not None]
    return SearchResult(list(gateways.values()), markers, doubts)


def belongs_to_user(folder: Path) -> bool:
    """Whether a folder exists and belongs to this user; always True on a system without user ids (Windows)."""
    try:
        return user_id() is None or os.lstat(folder).st_uid == user_id()
    except OSError:
        return False


def _all_endpoints(folder: Path) -> tuple[list[tuple[Path, ControlEndpoint]], list[str]]:
    """Return the control endpoints of every gateway that this user may ask, and what could not be searched."""
    endpoints: list[tuple[Path, ControlEndpoint]] = []
    doubts = []
    try:
        endpoints += exchange.read_endpoints(folder)
    except FileNotFoundError:
        pass
    except OSError as error:
        doubts.append(
            f"{folder}: {error.strerror}; cannot tell whether its gateway runs or was killed in motion; "
            "run this command as the user who runs the gateway"
        )
    for own_folder in find_folders()[0]:
        endpoints += _read_endpoints(own_folder, user_id())
    for other, owner in folders_of_others():
        endpoints += _read_endpoints(other, owner)
    return endpoints, doubts


def _read_endpoints(folder: Path, owner_uid: int | None) -> Sequence[tuple[Path, ControlEndpoint]]:
    try:
        return exchange.read_endpoints(folder, owner_uid)
    except OSError:
        return []


def _must_hold_endpoint(folder: Path) -> bool:
    """Whether a gateway with this state folder must have left an endpoint file in it that this user can read.

    That is so if the folder belongs to this user (every folder counts as root's) and can be written to.
    """
    try:
        if os.name != "posix":
            return os.access(folder, os.W_OK)
        room = os.statvfs(folder)
        mine = user_id() in (0, os.lstat(folder).st_uid)
        return mine and os.access(folder, os.W_OK) and room.f_bavail > 0 and (room.f_files == 0 or room.f_favail > 0)
    except OSError:
        return False


def explain_unreachable(process: processes.GatewayProcess) -> str:
    """Return a sentence about a gateway that cannot be asked: what it is, and how to stop its mount."""
    if may_reach(process):
        return (
            f"process {process.pid} is a gateway that commands cannot reach, because it had no folder to write to; "
            f"kill {process.pid} ends it, which stops its mount"
        )
    whose = user_name(process.user_id)
    return f"a gateway of {whose} runs as process {process.pid}: stop it as {whose}, or as root"


def explain_no_answer(pid: int) -> str:
    """Return a sentence about a gateway that does not answer: what the reason may be, and what to do."""
    ended = f"end it with kill -9 {pid}, then mount-gateway stop stops its mount without it"
    resume = f"it is suspended (Ctrl-Z?), and kill -CONT {pid} resumes it; or " if processes.is_suspended(pid) else ""
    return f"the gateway (process {pid}) does not answer: {resume}{ended}"


async def ask(endpoint: ControlEndpoint, request: Request, timeout: float) -> Answer | None:
    """Send a request and return the answer, a failed one if none comes; None if the gateway has ended."""
    number, parts, heard = new_request_number(), exchange.AnswerParts(), False
    datagram, loop = exchange.sign(endpoint.secret, number, f"ask {encode(request)}"), asyncio.get_running_loop()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.setblocking(False)
        try:
            sock.connect(("127.0.0.1", endpoint.port))
        except (OSError, OverflowError) as error:
            return _no_answer(f"the gateway (process {endpoint.pid}) cannot be reached: {error}")
        try:
            async with asyncio.timeout(timeout):
                silence = loop.time() + RECEIPT_TIMEOUT
                while heard or loop.time() <= silence:
                    await loop.sock_sendall(sock, datagram)
                    with contextlib.suppress(TimeoutError):
                        async with asyncio.timeout(RESEND_PERIOD):
                            while True:
                                message = exchange.verify(
                                    endpoint.secret, await loop.sock_recv(sock, exchange.MAX_DATAGRAM)
                                )
                                if message is not None and message[0] == number:
                                    heard = True
                                    if (answer := parts.add(message[1])) is not None:
                                        return msgspec.json.decode(answer, type=Answer)
        except ConnectionError:
            return _no_answer(explain_no_answer(endpoint.pid)) if processes.is_gateway(endpoint.pid) else None
        except (OSError, TimeoutError):
            pass
        return _no_answer(explain_no_answer(endpoint.pid)) if processes.exists(endpoint.pid) else None


def _no_answer(reason: str) -> Answer:
    return Answer(FAILED, reason, NoAnswer.__name__)


def running_gateways(mount_name: str | None, folder: str | None) -> list[ControlEndpoint]:
    """Return the gateways on this computer that accept requests, only of this mount and state folder if given."""
    gateways = search(scope_of(folder)).gateways
    return [endpoint for _, endpoint in gateways if exchange.is_listening(endpoint) and endpoint.matches(mount_name)]


async def send_request(endpoint: ControlEndpoint, request: Request, timeout: float = ANSWER_TIMEOUT) -> Answer:
    """Send a request and return the answer; if none comes, return a failed one with the fault ``NoAnswer``."""
    return await ask(endpoint, request, timeout) or _no_answer("the gateway has ended")


async def ask_state(endpoint: ControlEndpoint, fresh: bool = True, timeout: float = ANSWER_TIMEOUT) -> State | Answer:
    """Return the state of a gateway's mount, or the answer that explains why the gateway does not report it."""
    answer = await send_request(endpoint, StateRequest(fresh), timeout)
    try:
        return msgspec.json.decode(answer.text, type=State)
    except msgspec.MsgspecError:
        return answer._replace(outcome=FAILED)
