"""Stopping from outside: every mount on a state directory, with or without a running gateway.

A running gateway is asked. Where none runs and the last one ended in motion, the mount's port is opened and the stop
sent from here.
"""

from __future__ import annotations

import asyncio
from pathlib import Path

from gateway.assembly import Gateway
from gateway.config import MountConfig
from gateway.control import ACKNOWLEDGED, ask_to_stop, doors
from gateway.errors import UserError
from gateway.state import Marked, read_mark

STOPPED = "stopped"


async def stop_all(where: Path, only: str | None) -> list[tuple[str, str]]:
    """All at once: one that does not answer must not keep another one moving.

    -> for each mount its endpoint (empty: not known any more) and ``stopped`` or ``failed REASON``. Raises UserError
    where it cannot be seen what runs: that must not pass for nothing.
    """
    try:
        running = [(path, door) for path, door in doors(where) if _meant(door.mount, only)]
    except FileNotFoundError:
        return []
    except OSError as error:
        raise UserError(f"{where}: {error.strerror}; stop as the user that the gateway runs as") from None
    asked = await asyncio.gather(*(ask_to_stop(path, door) for path, door in running))
    outcomes = [(door.mount, answer) for (_, door), answer in zip(running, asked, strict=True) if answer]
    left = [mark for mark in _marks(where) if _meant(mark.mount, only) and mark.mount not in dict(outcomes)]
    rescued = await asyncio.gather(*(_rescue(mark, where) for mark in left))
    return outcomes + [(mark.mount, answer) for mark, answer in zip(left, rescued, strict=True)]


def _meant(mount: str, only: str | None) -> bool:
    """An endpoint by its whole text or by where it is; one that is not known could be any."""
    return only is None or not mount or only in (mount, mount.partition("@")[2])


def _marks(where: Path) -> list[Marked]:
    return [mark for mark in map(read_mark, sorted(where.glob("*.moving"))) if mark is not None]


async def _rescue(mark: Marked, where: Path) -> str:
    """Open the port of a mount that a killed gateway has left moving -> ``stopped`` or ``failed REASON``.

    A gateway without clients does it: whatever begins on such a mark sends the stop before anything else.
    """
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
        return STOPPED
    except TimeoutError:
        return f"failed {line.reason or 'no answer from the mount'}"
    finally:
        await gateway.close()
