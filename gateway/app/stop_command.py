"""``mount-gateway stop``: stops every mount of a state folder, with or without a running gateway.

A running gateway is asked to. If none runs and the last one ended while its mount moved, the mount's port is opened and
the stop is sent from here. Either way the mount counts as stopped only when it has been seen at rest.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import Sequence
from pathlib import Path

from msgspec import Struct

from gateway.app.control.exchange import ControlEndpoint
from gateway.app.control.orders import ACKNOWLEDGED, LONGEST, STOPPED
from gateway.app.reach import Scope, ask, doubt, look, reachable, unseen
from gateway.app.state.file import MarkerContent
from gateway.core.errors import Fault, UserError
from gateway.mount.readings.rest import come_to_rest
from gateway.system.runtime_folders import user

#: A gateway that is seen and cannot be asked may be just beginning, or ending: so many looks, so many seconds apart.
LOOKS, BETWEEN = 5, 0.25


class Report(Struct):
    """For each mount its endpoint (empty: not known any more) and what was answered; what could not be known."""

    outcomes: list[tuple[str, str]]
    doubts: list[str]


async def order_all(scope: Scope, only: str | None, word: str) -> Report:
    """Give an order to every gateway in the scope; what was left in motion is stopped, but not at ``release``.

    All at once: one that does not answer must not keep another one moving, nor must whatever cannot be known.
    """
    report = Report([], [])
    asked: set[tuple[int, int]] = set()
    for attempt in range(LOOKS):
        found = look(scope)
        new = [
            (path, door)
            for path, door in found.gateways
            if (_meant(door.mount, only) or only == door.name) and (door.pid, door.port) not in asked
        ]
        asked |= {(door.pid, door.port) for _, door in new}
        marks = {mark.mount: mark for mark in found.marks if _meant(mark.mount, only)}
        if word == "release" or attempt > 0:
            marks.clear()
        mounts = list(dict.fromkeys([*(door.mount for _, door in new), *marks]))
        told = await asyncio.gather(
            *(
                _of_mount([one for one in new if one[1].mount == mount], word, marks.get(mount), scope.folder)
                for mount in mounts
            )
        )
        report.outcomes += [(mount, answer) for mount, answers in zip(mounts, told, strict=True) for answer in answers]
        others = unseen(scope)
        report.doubts = [*found.doubts, *map(doubt, others)]
        if not any(reachable(process) for process in others):
            break
        await asyncio.sleep(BETWEEN)
    return report


async def _of_mount(
    gateways: Sequence[tuple[Path, ControlEndpoint]], word: str, left: MarkerContent | None, folder: Path
) -> list[str]:
    """The answers of a mount's gateways; where none is there any more, what comes of stopping it from here."""
    asked = await asyncio.gather(*(ask(door, word, LONGEST) for _, door in gateways))
    for (path, _), answer in zip(gateways, asked, strict=True):
        if answer is None:
            _take_away(path)
    answers = [answer for answer in asked if answer is not None]
    return [await _rescue(left, folder)] if left is not None and not answers else answers


def _meant(mount: str, only: str | None) -> bool:
    """An endpoint by its whole text or by where it is; one that is not known could be any."""
    return only is None or not mount or only in (mount, mount.partition("@")[2])


def _take_away(path: Path) -> None:
    """What a gateway has left that is gone; in a folder of somebody else's nothing is touched."""
    with contextlib.suppress(OSError):
        if user() is None or os.lstat(path.parent).st_uid == user():
            path.unlink()


async def _rescue(mark: MarkerContent, where: Path) -> str:
    """Open the port of a mount that a killed gateway has left moving -> ``stopped`` or ``failed REASON``.

    A gateway without clients does it: whatever begins on such a marker sends the stop before anything else.
    """
    from gateway.app.config import MountConfig
    from gateway.app.gateway import Gateway

    if not mark.mount:
        return "failed its motion marker cannot be read; start its gateway, which stops the mount first"
    try:
        gateway = Gateway(MountConfig(mark.mount, baud=mark.baud, state=str(where)), [])
        await gateway.open()
    except UserError as error:
        return f"failed {error}"
    assert gateway.keeping is not None
    wanted, line = gateway.controller.wanted, gateway.controller.line
    try:
        if not gateway.keeping.held:
            return "failed a gateway holds its state files but does not answer"
        async with asyncio.timeout(ACKNOWLEDGED):
            while wanted.owed:
                await asyncio.sleep(0.02)
        await come_to_rest(gateway.controller.context, gateway.controller.reader)
        return STOPPED
    except TimeoutError:
        return f"failed {line.reason or 'no answer from the mount'}"
    except Fault as fault:
        return f"failed {fault}"
    finally:
        await gateway.close()
