"""Stopping from outside: every mount on a state folder, with or without a running gateway.

A running gateway is asked. Where none runs and the last one ended in motion, the mount's port is opened and the stop
sent from here. Either way the mount must be seen to rest before it counts as stopped.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
from pathlib import Path

from msgspec import Struct

from gateway.control import ask
from gateway.control.orders import ACKNOWLEDGED, LONGEST, STOPPED
from gateway.errors import Fault, UserError
from gateway.reach import Scope, find
from gateway.runtime import user
from gateway.state import Marked


class Report(Struct):
    """For each mount its endpoint (empty: not known any more) and what was answered; what could not be known."""

    outcomes: list[tuple[str, str]]
    doubts: list[str]


async def order_all(scope: Scope, only: str | None, word: str) -> Report:
    """Give an order to every gateway in the scope; what was left in motion is stopped, but not at ``release``.

    All at once: one that does not answer must not keep another one moving.
    """
    found = await find(scope)
    running = [(path, door) for path, door in found.gateways if _meant(door.mount, only)]
    asked = await asyncio.gather(*(ask(door, word, LONGEST) for _, door in running))
    outcomes = [(door.mount, answer) for (_, door), answer in zip(running, asked, strict=True) if answer is not None]
    for (path, _), answer in zip(running, asked, strict=True):
        if answer is None:
            _take_away(path)
    left = [mark for mark in found.marks if _meant(mark.mount, only) and mark.mount not in dict(outcomes)]
    rescued = [] if word == "release" else await asyncio.gather(*(_rescue(mark, scope.folder) for mark in left))
    outcomes += [(mark.mount, answer) for mark, answer in zip(left, rescued, strict=False)]
    return Report(outcomes, found.doubts)


def _meant(mount: str, only: str | None) -> bool:
    """An endpoint by its whole text or by where it is; one that is not known could be any."""
    return only is None or not mount or only in (mount, mount.partition("@")[2])


def _take_away(path: Path) -> None:
    """What a gateway has left that is gone; in a folder of somebody else's nothing is touched."""
    with contextlib.suppress(OSError):
        if user() is None or os.lstat(path.parent).st_uid == user():
            path.unlink()


async def _rescue(mark: Marked, where: Path) -> str:
    """Open the port of a mount that a killed gateway has left moving -> ``stopped`` or ``failed REASON``.

    A gateway without clients does it: whatever begins on such a mark sends the stop before anything else.
    """
    from gateway.assembly import Gateway
    from gateway.config import MountConfig
    from gateway.hub.rest import come_to_rest

    if not mark.mount:
        return "failed its motion mark cannot be read; start its gateway, which stops it first"
    try:
        gateway = Gateway(MountConfig(mark.mount, baud=mark.baud, state=str(where)), [])
        await gateway.open()
    except UserError as error:
        return f"failed {error}"
    assert gateway.hub is not None and gateway.keeping is not None
    motions, line = gateway.hub.motions, gateway.hub.line
    try:
        if not gateway.keeping.held:
            return "failed a gateway has its files and does not answer"
        async with asyncio.timeout(ACKNOWLEDGED):
            while motions.owed:
                await asyncio.sleep(0.02)
        await come_to_rest(gateway.hub)
        return STOPPED
    except TimeoutError:
        return f"failed {line.reason or 'no answer from the mount'}"
    except Fault as fault:
        return f"failed {fault}"
    finally:
        await gateway.close()
