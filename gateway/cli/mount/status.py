"""``status``: shows the state of mounts, as running gateways report it.

It shows everything once, for every gateway; with ``--watch`` one mount on one line, every second until Ctrl-C.
"""

from __future__ import annotations

import argparse
import asyncio
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

import msgspec

from gateway.app.control.exchange import ControlEndpoint
from gateway.app.status import MAX_POSITION_AGE, AverageRate, ServedSurface, State, activity, position_text, status_text
from gateway.cli.command_line import Commands
from gateway.cli.mount import gateway_client
from gateway.cli.serve.signals import race
from gateway.core.requests import Answer
from gateway.system import streams

EXAMPLES = """\
Examples:
  mount-gateway status
  mount-gateway status --watch           on one line, until Ctrl-C
  mount-gateway status --json | jq .[0].look.position
"""


def add_status(commands: Commands) -> None:
    command = commands.add_parser(
        "status",
        description="Shows where each mount of this computer points, what it does and for whom, which programs are "
                    "connected and where others can connect, which limits apply, and what was refused or ended in the "
                    "last minute. Exit code 1: no gateway runs here, or one does not answer.",
        epilog=EXAMPLES,
    )  # fmt: skip
    how = command.add_mutually_exclusive_group()
    how.add_argument("--watch", action="store_true", help="one mount on one line, every second until Ctrl-C")
    how.add_argument("--json", action="store_true", help="print JSON: a list with one object for each mount")
    gateway_client.add_gateway_flags(command)
    command.set_defaults(run=_run_status)


def _run_status(arguments: argparse.Namespace) -> int:
    if arguments.watch:
        return gateway_client.run_with_gateway(arguments, _watch_mount)
    return asyncio.run(_show_once(arguments))


async def _show_once(arguments: argparse.Namespace) -> int:
    from gateway.app.control.reach import ask_state

    endpoints = gateway_client.chosen_gateways(arguments)
    answers = await asyncio.gather(*map(ask_state, endpoints))
    states = sorted([answer for answer in answers if isinstance(answer, State)], key=lambda state: state.folder)
    for endpoint, answer in zip(endpoints, answers, strict=True):
        if isinstance(answer, Answer):
            streams.warn(f"{endpoint.title}: {answer.text}", streams.ERROR)
    if arguments.json:
        print(msgspec.json.format(msgspec.json.encode(states), indent=2).decode())
    elif states:
        print("\n\n".join("\n".join(block) for block in state_blocks(states)))
    if not endpoints:
        gateway_client.report_no_gateway(arguments)
    return 0 if endpoints and len(states) == len(endpoints) else 1


async def _watch_mount(endpoint: ControlEndpoint, interrupted: asyncio.Event) -> int:
    from gateway.app.control.reach import ask_state
    from gateway.cli.serve.live import Screen, find_terminal

    screen, rate, shown = Screen(find_terminal()), AverageRate(), tuple[ServedSurface, ...]()
    now = asyncio.get_running_loop().time
    try:
        while (answer := await race(interrupted, ask_state(endpoint))) is not None:
            if isinstance(answer, Answer):
                screen.clear()
                return gateway_client.print_answer(answer)
            if answer.served != shown:
                shown = answer.served
                for surface in shown:
                    screen.say(str(surface))
            look = msgspec.structs.replace(answer.look, rate=rate.add_sample(now(), answer.answers))
            if screen.terminal is not None:
                screen.show_status(status_text([look], screen.columns))
            else:
                print(status_text([look]), flush=True)
            if await gateway_client.cancelled_while_waiting(interrupted):
                break
    finally:
        screen.clear()
    return 0


def state_blocks(states: Sequence[State]) -> Iterator[list[str]]:
    """Yield the lines of each mount. With several state folders, a heading names the folder of the mounts below it."""
    folders = {state.folder for state in states}
    above = None
    for state in states:
        heading = [f"of the state folder {state.folder}:"]
        yield [*(heading if len(folders) > 1 and state.folder != above else []), *state_lines(state)]
        above = state.folder


def state_lines(state: State) -> Iterator[str]:
    """Yield the lines that show a mount's state to the user."""
    look = state.look
    yield f"{look.name} ({state.mount})" if look.name != state.mount else state.mount
    line = f"{look.state}{': ' * bool(look.reason)}{look.reason}"
    position = position_text(look)  # includes the age of an old position
    if look.position is not None and look.age <= MAX_POSITION_AGE:
        position += f", {look.age:.0f} s ago"
    doing = activity(look) if look.online else ""  # not known now
    rows = {
        "mount": [state.identity_text or "not identified yet"],
        "now": [f"{position}; {doing}" if doing else position],
        "orders": state.wanted or ["none: no motion"],
        "limits": ["; ".join(state.allowed)],
        "site": [state.site or "not known: altitudes cannot be computed"],
        "clock": [state.clock or "not known"],
        "line": [f"{line}; an answer takes {state.reply:.2f} s, {state.answers} so far"],
        "served": [str(surface) for surface in state.served] or ["no surface"],
        "programs": [", ".join(_with_counts(state.programs)) or "none"],
        "state": [state.folder],
        "lately": state.lately or ["nothing was refused or ended in the last minute"],
    }
    for name, sentences in rows.items():
        for number, sentence in enumerate(sentences):
            yield f"  {name if number == 0 else '':<9} {sentence}"


def _with_counts(names: Iterable[str]) -> Iterator[str]:
    """Return every name once, with a count if it occurs several times."""
    return (f"{name} ({often} times)" if often > 1 else name for name, often in Counter(names).items())
