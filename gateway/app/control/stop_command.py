"""``mount-gateway stop``: stops every mount of a state folder, with or without a running gateway.

A running gateway is asked to stop its mount. If none runs and the last one ended while its mount moved, this process
opens the mount's port and sends the stop itself. In both cases the mount counts as stopped only when its position shows
that it is at rest. A running gateway also reports a sleeping mount as stopped.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Sequence
from pathlib import Path

from msgspec import Struct, field

from gateway.app.control.exchange import ControlEndpoint, is_listening, motion_markers
from gateway.app.control.orders import STOP_ACK_TIMEOUT, STOP_TIMEOUT, STOPPED_ANSWER
from gateway.app.control.reach import (
    Scope,
    ask,
    belongs_to_user,
    explain_unreachable,
    may_reach,
    search,
    unreachable_gateways,
)
from gateway.app.state.file import MarkerContent
from gateway.core.errors import Fault, UserError
from gateway.core.requests import FAILED, Answer, ReleaseHoldRequest, StopOrHold
from gateway.mount.readings.rest import wait_for_rest
from gateway.system.processes import age

#: A gateway process without an endpoint may be starting: how many times to search for its endpoint, seconds between
#: two searches, and the age in seconds above which a process is not starting any more.
TRIES, SEARCH_PERIOD, MAX_START = 9, 0.125, 30.0


class StopReport(Struct):
    """The result of a stop: a (mount, answer) pair for each gateway, warnings, and mounts that were not selected.

    The mount is given by its name, else by its endpoint; it is an empty text if neither is known.
    """

    mount_answers: list[tuple[str, Answer]]
    warnings: list[str]
    other_mounts: set[str] = field(default_factory=set)


async def request_all(scope: Scope, mount_name: str | None, request: StopOrHold) -> StopReport:
    """Send a request to the gateways in the scope; unless it is ``ReleaseHoldRequest``, also stop mounts left moving.

    ``mount_name`` selects a mount (None: all). All are stopped in parallel: a silent gateway delays no other mount.
    """
    report = StopReport([], [])
    asked: set[tuple[int, int]] = set()
    for attempt in range(TRIES):
        scan = search(scope)
        new = [
            (path, endpoint)
            for path, endpoint in scan.gateways
            if (not endpoint.mount or endpoint.matches(mount_name)) and (endpoint.pid, endpoint.port) not in asked
        ]
        asked |= {(endpoint.pid, endpoint.port) for _, endpoint in new}
        names = {endpoint.mount: endpoint.title for _, endpoint in scan.gateways}
        meant = {endpoint.mount for _, endpoint in new}
        markers = {
            mark.mount: (folder, mark)
            for folder, mark in scan.markers
            if mount_name in (None, mark.mount, mark.mount.partition("@")[2]) or mark.mount in ("", *meant)
        }
        report.other_mounts |= {
            names.get(mount, mount)
            for mount in (
                *(endpoint.mount for _, endpoint in scan.gateways if is_listening(endpoint)),
                *(mark.mount for _, mark in scan.markers),
            )
            if mount not in meant and mount not in markers
        }
        if isinstance(request, ReleaseHoldRequest) or attempt > 0:
            markers.clear()
        mounts = list(dict.fromkeys([*(endpoint.mount for _, endpoint in new), *markers]))
        answers_by_mount = await asyncio.gather(
            *(
                _request_mount([entry for entry in new if entry[1].mount == mount], request, markers.get(mount))
                for mount in mounts
            )
        )
        report.mount_answers += [
            (names.get(mount, mount), answer)
            for mount, answers in zip(mounts, answers_by_mount, strict=True)
            for answer in answers
        ]
        others = unreachable_gateways(scope)
        report.warnings = [*scan.warnings, *map(explain_unreachable, others)]
        coming = [process for process in others if may_reach(process)]
        if not coming or attempt == TRIES - 1 or (attempt and all(age(process.pid) > MAX_START for process in coming)):
            break
        await asyncio.sleep(SEARCH_PERIOD)
    return report


async def _request_mount(
    gateways: Sequence[tuple[Path, ControlEndpoint]], request: StopOrHold, marker: tuple[Path, MarkerContent] | None
) -> list[Answer]:
    """Return the answers of a mount's gateways; if none runs now, stop the mount directly and return that answer."""
    asked = await asyncio.gather(*(ask(endpoint, request, STOP_TIMEOUT) for _, endpoint in gateways))
    answers = [answer for answer in asked if answer is not None]
    if marker is not None and not answers:
        folder, mark = marker
        answers = [await _stop_directly(mark, folder)]
    for (path, endpoint), answer in zip(gateways, asked, strict=True):
        if answer is None and not motion_markers(endpoint) and belongs_to_user(path.parent):
            with contextlib.suppress(OSError):  # it has ended, and has left its endpoint file
                path.unlink()
    return answers


async def _stop_directly(marker: MarkerContent, folder: Path) -> Answer:
    """Stop a mount that a killed gateway has left moving.

    This opens a gateway without surfaces: a gateway that finds a marker sends the stop before anything else.
    """
    from gateway.app.config import MountConfig
    from gateway.app.gateway import Gateway

    if not marker.mount:
        return Answer(FAILED, "its motion marker cannot be read; start its gateway, which stops the mount first")
    try:
        gateway = Gateway(MountConfig(marker.mount, baud=marker.baud, state=str(folder)), [])
        await gateway.open()
    except UserError as error:
        return Answer(FAILED, str(error))
    assert gateway.store is not None
    wanted, line = gateway.controller.wanted, gateway.controller.line
    try:
        if not gateway.store.has_lock:
            return Answer(FAILED, "a gateway uses its state files, but does not answer")
        async with asyncio.timeout(STOP_ACK_TIMEOUT):
            while wanted.stop_owed:
                await asyncio.sleep(0.02)
        await wait_for_rest(gateway.controller.context, gateway.controller.reader)
        return STOPPED_ANSWER
    except TimeoutError:
        return Answer(FAILED, line.down_cause or "no answer from the mount")
    except Fault as fault:
        return Answer(FAILED, str(fault))
    finally:
        await gateway.close()
