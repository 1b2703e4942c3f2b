"""``status``: what is wanted of the mounts, what is allowed, and what is seen, by the gateways that run."""

from __future__ import annotations

import argparse
import asyncio
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from gateway.cli.help import Commands

if TYPE_CHECKING:
    from gateway.app.status import State

EXAMPLES = """\
Examples:
  mount-gateway status
  mount-gateway status --json | jq .[0].look.position
"""


def add(commands: Commands) -> None:
    from gateway.cli.mount.asking import add_which

    status = commands.add_parser(
        "status", help="how the mount is: what is wanted, allowed and seen by the gateway that runs",
        description="Tells of every gateway that runs here where its mount points, what it does and for whom, which "
                    "programs are connected, how its line is, what limits hold, and what was refused or ended in the "
                    "last minute. Exit code 1: no gateway runs here, or one does not answer.",
        epilog=EXAMPLES,
    )  # fmt: skip
    status.add_argument("--json", action="store_true", help="for programs: a list with one object for each mount")
    add_which(status)
    status.set_defaults(run=_status)


def _status(arguments: argparse.Namespace) -> int:
    return asyncio.run(_told(arguments))


async def _told(arguments: argparse.Namespace) -> int:
    import msgspec

    from gateway.app.control import commands as wishes
    from gateway.app.status import State
    from gateway.cli.mount.asking import found, nobody, wished
    from gateway.system import journal, streams

    doors = found(arguments)
    answers = await asyncio.gather(*(wished(door, wishes.written(wishes.See())) for door in doors))
    states, bad = [], 0
    for door, answer in zip(doors, answers, strict=True):
        try:
            states.append(msgspec.json.decode(answer, type=State))
        except msgspec.MsgspecError:
            bad += 1
            streams.warn(f"{door.name or door.mount}: {answer.removeprefix('failed ')}", journal.ERROR)
    streams.tolerate()
    if arguments.json:
        streams.say(msgspec.json.format(msgspec.json.encode(states), indent=2).decode())
    elif states:
        streams.say("\n\n".join("\n".join(lines(state)) for state in states))
    if not doors:
        nobody(arguments)
    return 1 if bad or not doors else 0


def lines(state: State) -> Iterator[str]:
    """A mount's state for a person."""
    from gateway.app.status import OLD, does, where

    look = state.look
    yield f"{look.name} ({state.mount})" if look.name != state.mount else state.mount
    line = f"{look.state}{': ' * bool(look.reason)}{look.reason}"
    seen = where(look)  # with its age, where it is old
    if look.position is not None and look.age <= OLD:
        seen += f", {look.age:.0f} s ago"
    doing = "" if look.state in ("opening", "down") else does(look)  # nobody knows what it does now
    told = {
        "mount": [state.found or "has not said yet which one it is"],
        "seen": [f"{seen}; {doing}" if doing else seen],
        "wanted": state.wanted or ["no motion"],
        "allowed": ["; ".join(state.allowed)],
        "site": [state.site or "not known: altitudes cannot be reckoned"],
        "clock": [state.clock or "not known"],
        "line": [f"{line}; an answer takes {state.reply:.2f} s, {state.answers} so far"],
        "programs": [", ".join(_counted(state.programs)) or "none"],
        "lately": state.lately or ["nothing was refused in the last minute"],
    }
    for name, sentences in told.items():
        for number, sentence in enumerate(sentences):
            yield f"  {name if number == 0 else '':<9} {sentence}"


def _counted(names: Iterable[str]) -> Iterator[str]:
    """Every name once, with how often where that is more."""
    return (f"{name} ({often} times)" if often > 1 else name for name, often in Counter(names).items())
