"""``stop``: end every motion of every mount here, with or without a running gateway.

A running gateway is asked. Where none runs and the last one ended in motion, the mount's port is opened and the stop
sent from here: that is what makes ``ExecStopPost=mount-gateway stop`` worth having.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
from pathlib import Path
from typing import Any

from gateway.control import ACKNOWLEDGED, ask_to_stop, doors
from gateway.errors import UserError
from gateway.state import Marked, directory, read_mark


def add(commands: Any) -> None:
    """Put the command into the parser."""
    stop = commands.add_parser("stop", help="stop the mount: of every running gateway, and of one that was killed")
    stop.add_argument("--mount", metavar="NAME", help="only this one: its endpoint, or the part behind @")
    stop.add_argument("--state", metavar="PATH", help="the directory that the gateway was told to keep its state in")
    stop.set_defaults(run=_stop)


def _stop(arguments: argparse.Namespace) -> int:
    return asyncio.run(_stop_all(directory(arguments.state), arguments.mount))


async def _stop_all(where: Path, only: str | None) -> int:
    """All at once: one that does not answer must not keep another one moving. -> the exit code."""
    running = [(path, door) for path, door in doors(where) if _meant(door.mount, only)]
    asked = await asyncio.gather(*(ask_to_stop(path, door) for path, door in running))
    outcomes = [(door.mount, answer) for (_, door), answer in zip(running, asked, strict=True) if answer]
    left = [mark for mark in _marks(where) if _meant(mark.mount, only) and mark.mount not in dict(outcomes)]
    outcomes += zip((mark.mount for mark in left), await asyncio.gather(*(_rescue(mark, where) for mark in left)),
                    strict=True)
    for mount, answer in outcomes:
        good = answer == "stopped"
        words = "stopped" if good else f"not stopped: {answer.removeprefix('failed ')}"
        print(f"{mount or 'a mount that is not known any more'}: {words}", file=sys.stdout if good else sys.stderr)
    if not outcomes:
        print(f"nothing to stop: no gateway runs{f' for {only}' if only else ''}, and none ended in motion")
    return 0 if all(answer == "stopped" for _, answer in outcomes) else 1


def _meant(mount: str, only: str | None) -> bool:
    """An endpoint by its whole text or by where it is; one that is not known could be any."""
    return only is None or not mount or only in (mount, mount.partition("@")[2])


def _marks(where: Path) -> list[Marked]:
    return [mark for mark in map(read_mark, sorted(where.glob("*.moving"))) if mark is not None]


async def _rescue(mark: Marked, where: Path) -> str:
    """Open the port of a mount that a killed gateway has left moving -> ``stopped`` or ``failed REASON``.

    A gateway without clients does it: whatever begins on such a mark sends the stop before anything else.
    """
    from gateway.assembly import Gateway
    from gateway.config import Config, MountConfig

    if not mark.mount:
        return "failed its motion mark cannot be read; start its gateway, which stops it first"
    try:
        gateway = Gateway(Config(MountConfig(mark.mount, baud=mark.baud, state=str(where)), []))
        await gateway.open()
    except UserError as error:
        return f"failed {error}"
    assert gateway.hub is not None
    motions, line = gateway.hub.motions, gateway.hub.line
    try:
        if not gateway.keeping.held:
            return "failed a gateway has its files and does not answer"
        async with asyncio.timeout(ACKNOWLEDGED):
            while motions.owed:
                await asyncio.sleep(0.02)
        return "stopped"
    except TimeoutError:
        return f"failed {line.reason or 'no answer from the mount'}"
    finally:
        await gateway.close()
