"""``watch``: one line that tells how the mount is, renewed every second until Ctrl-C."""

from __future__ import annotations

import argparse
import asyncio
from typing import TYPE_CHECKING

from gateway.cli.help import Commands

if TYPE_CHECKING:
    from gateway.app.control.endpoints import ControlEndpoint


def add(commands: Commands) -> None:
    from gateway.cli.mount.asking import add_which

    watch = commands.add_parser(
        "watch", help="tell every second how the mount is, until Ctrl-C",
        description="Tells every second where the mount of the gateway that runs here points and what it does: on a "
                    "terminal on one line, else line by line.",
        epilog="Example:\n  mount-gateway watch\n",
    )  # fmt: skip
    add_which(watch)
    watch.set_defaults(run=_watch)


def _watch(arguments: argparse.Namespace) -> int:
    from gateway.cli.mount.asking import carried_out

    return carried_out(arguments, _tell)


async def _tell(door: ControlEndpoint, done: asyncio.Event) -> int:
    import msgspec

    from gateway.app.control import commands as wishes
    from gateway.app.status import Rate, State, status
    from gateway.cli.mount.asking import over, told, unless, wished
    from gateway.cli.serve.live import Screen, find_terminal
    from gateway.system import streams

    screen, rate = Screen(find_terminal()), Rate()
    streams.tolerate()
    now = asyncio.get_running_loop().time
    try:
        while (answer := await unless(done, wished(door, wishes.written(wishes.See())))) is not None:
            try:
                state = msgspec.json.decode(answer, type=State)
            except msgspec.MsgspecError:
                screen.clear()
                return told(answer)
            look = msgspec.structs.replace(state.look, rate=rate.per_second(now(), state.answers))
            if screen.terminal is not None:
                screen.show(status([look], screen.columns))
            else:
                streams.say(status([look]))
            if await over(done):
                break
    finally:
        screen.clear()
    return 0
