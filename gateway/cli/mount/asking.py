"""What the commands share that speak to a running gateway: which gateway is meant, and what it answers.

The exit code is 0 when the request was carried out, 1 when the gateway refused it or none runs, and 2 when it cannot be
done as typed.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
from collections.abc import Callable, Coroutine, Iterable

from gateway.app.control.exchange import ControlEndpoint
from gateway.cli.serve.signals import until_signal
from gateway.core.errors import UserError
from gateway.system import streams

#: Seconds within which a gateway has carried out whatever takes no time of its own.
ANSWERED = 15.0
#: Seconds between two looks at what is under way.
EVERY = 1.0
NOBODY = (
    "no gateway runs here{which}; mount-gateway run starts one, and --state PATH names the folder of one that "
    "systemd runs"
)


def add_which(command: argparse.ArgumentParser, which: str = "which one, where several run") -> None:
    """The flags that say which gateway is meant."""
    command.add_argument("--mount", metavar="NAME", help=f"{which}: its name, its endpoint, or the part behind @")
    command.add_argument(
        "--state", metavar="PATH", help="only of this folder: where the gateway was told to keep its state"
    )


def found(arguments: argparse.Namespace, all_of_them: bool = False) -> list[ControlEndpoint]:
    """The gateways that run and are meant, or ``all_of_them`` that could be."""
    from gateway.app.control.exchange import listened
    from gateway.app.reach import look, scope_of

    only = None if all_of_them else arguments.mount
    return [
        door
        for _, door in look(scope_of(arguments.state)).gateways
        if listened(door) and (only is None or only in (door.name, door.mount, door.mount.partition("@")[2]))
    ]


def the_one(arguments: argparse.Namespace) -> ControlEndpoint | None:
    """The gateway that is meant; None where none runs, which is said. Raises UserError where it could be several."""
    doors = found(arguments)
    if len(doors) > 1:
        raise UserError(f"{len(doors)} mounts run here; say which one is meant: {_flags(doors)}")
    if not doors:
        nobody(arguments)
        return None
    return doors[0]


def _flags(doors: Iterable[ControlEndpoint]) -> str:
    """What names each of these gateways."""
    return " or ".join(sorted(f"--mount {door.name or door.mount}" for door in doors))


def nobody(arguments: argparse.Namespace) -> None:
    """Say that no gateway runs."""
    from gateway.app.reach import scope_of, unseen
    from gateway.system.runtime_folders import user_name

    others = found(arguments, all_of_them=True) if arguments.mount else []
    if others:
        streams.warn(f"no gateway runs here for {arguments.mount}; write {_flags(others)}", streams.ERROR)
        return
    which = f" for {arguments.mount}" if arguments.mount else ""
    streams.warn(NOBODY.format(which=which), streams.ERROR)
    for process in unseen(scope_of(arguments.state)):
        whose = user_name(process.user)
        streams.warn(
            f"process {process.pid} is a gateway of {whose} that cannot be asked from here: ask as {whose} or "
            "as root; if that is you, it is of an older version",
            streams.ERROR,
        )


async def wished(door: ControlEndpoint, line: str, seconds: float = ANSWERED) -> str:
    """What the gateway answers to a request, ``failed REASON`` where nobody does."""
    from gateway.app.reach import ask

    answer = await ask(door, f"wish {line}", seconds)
    if answer is None:
        return "failed the gateway has ended"
    if answer.startswith("failed this gateway knows no order"):
        return "failed this gateway is of an older version, and takes no wishes from the command line; start it anew"
    return answer


def told(answer: str) -> int:
    """Say what came of a request -> the exit code."""
    how, _, words = answer.partition(" ")
    plain = "".join(letter if letter.isprintable() else "?" for letter in words)
    if how == "failed":
        streams.warn(plain, streams.ERROR)
        return 1
    streams.tolerate()
    streams.say(plain)
    return 0


def carried_out(
    arguments: argparse.Namespace, work: Callable[[ControlEndpoint, asyncio.Event], Coroutine[object, object, int]]
) -> int:
    """Run something with the one gateway that is meant, and an event which Ctrl-C sets -> the exit code."""
    door = the_one(arguments)
    if door is None:
        return 1

    async def run() -> int:
        return await work(door, until_signal())

    return asyncio.run(run())


async def over(done: asyncio.Event) -> bool:
    """Let the time to the next look pass -> whether Ctrl-C has come."""
    with contextlib.suppress(TimeoutError):
        await asyncio.wait_for(done.wait(), EVERY)
    return done.is_set()
