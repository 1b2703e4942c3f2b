"""The common part of commands that send a request to a running gateway: choosing the gateway, and the exit code.

The exit code is 0 if the request was carried out, 1 if it was refused or no gateway runs, 2 for a typing mistake.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
from collections import Counter
from collections.abc import Callable, Coroutine, Iterable
from typing import TYPE_CHECKING

from gateway.app.control.exchange import ControlEndpoint
from gateway.cli.serve.signals import end_signal_event
from gateway.core.errors import UserError
from gateway.system import streams
from gateway.system.runtime_folders import user_name

if TYPE_CHECKING:
    from gateway.core.requests import Answer

#: Seconds between two requests for the progress.
PROGRESS_PERIOD = 1.0
NO_GATEWAY_TEXT = "no gateway runs here{which}; mount-gateway run starts one, and root finds those of other users, too"


def add_gateway_flags(command: argparse.ArgumentParser, hint: str = "which mount, if there are several") -> None:
    """Add the flags that choose a gateway; ``hint`` begins the help of ``--mount``."""
    command.add_argument(
        "--mount", metavar="NAME", help=f"{hint}: its name, or what --mount of run says, or the part of that behind @"
    )
    command.add_argument("--state", metavar="PATH", help="only gateways with this state folder")


def chosen_gateways(arguments: argparse.Namespace, ignore_mount: bool = False) -> list[ControlEndpoint]:
    """Return the running gateways that the flags choose; with ``ignore_mount`` the flag ``--mount`` does not count."""
    from gateway.app.control.reach import running_gateways

    return running_gateways(None if ignore_mount else arguments.mount, arguments.state)


def chosen_gateway(arguments: argparse.Namespace) -> ControlEndpoint | None:
    """Return the chosen gateway. If none runs, report it and return None. Raises UserError if the flags fit several."""
    endpoints = chosen_gateways(arguments)
    if len(endpoints) > 1:
        title, times = Counter(endpoint.title for endpoint in endpoints).most_common(1)[0]
        if times == 1:
            names = _mount_flags(endpoint.title for endpoint in endpoints)
            raise UserError(f"{len(endpoints)} mounts run on this computer; choose one: {names}")
        processes = " and ".join(str(endpoint.pid) for endpoint in endpoints if endpoint.title == title)
        raise UserError(
            f"{times} gateways here have {title} (processes {processes}): end one of them, or give its mount a name "
            '(name = "pier" under [mount] of its gateway.toml), which --mount takes'
        )
    if not endpoints:
        report_no_gateway(arguments)
        return None
    return endpoints[0]


def _mount_flags(names: Iterable[str]) -> str:
    """Return the flags that choose each of these mounts."""
    return " or ".join(sorted(f"--mount {name}" for name in names))


def no_such_mount_message(mount: str, mount_names: Iterable[str]) -> str:
    """Return the message that no gateway on this computer has this mount; it lists the mounts that gateways have."""
    return f"no gateway runs here for {mount}; write {_mount_flags(mount_names)}"


def report_no_gateway(arguments: argparse.Namespace) -> None:
    """Report that no gateway runs, or none with the mount that was named."""
    from gateway.app.control.reach import scope_of, unreachable_gateways

    others = chosen_gateways(arguments, ignore_mount=True) if arguments.mount else []
    if others:
        streams.warn(no_such_mount_message(arguments.mount, (endpoint.title for endpoint in others)), streams.ERROR)
        return
    which = f" for {arguments.mount}" if arguments.mount else ""
    streams.warn(NO_GATEWAY_TEXT.format(which=which), streams.ERROR)
    for process in unreachable_gateways(scope_of(arguments.state)):
        whose = user_name(process.user_id)
        streams.warn(
            f"process {process.pid} is a gateway of {whose} that this user may not reach: run this command as "
            f"{whose} or as root",
            streams.ERROR,
        )


def print_answer(answer: Answer) -> int:
    """Print the result of a request, a failure on stderr, and return the exit code, 0 or 1."""
    plain = "".join(letter if letter.isprintable() else "?" for letter in answer.text)
    if answer.outcome == "failed":
        streams.warn(plain, streams.ERROR)
        return 1
    print(plain)
    return 0


def run_with_gateway(
    arguments: argparse.Namespace, work: Callable[[ControlEndpoint, asyncio.Event], Coroutine[object, object, int]]
) -> int:
    """Run ``work`` with the chosen gateway and an event that Ctrl-C sets; return its exit code, 1 without a gateway."""
    endpoint = chosen_gateway(arguments)
    if endpoint is None:
        return 1

    async def run() -> int:
        return await work(endpoint, end_signal_event())

    return asyncio.run(run())


async def cancelled_while_waiting(interrupted: asyncio.Event) -> bool:
    """Wait ``PROGRESS_PERIOD`` seconds or until the user presses Ctrl-C; return whether that was pressed."""
    with contextlib.suppress(TimeoutError):
        await asyncio.wait_for(interrupted.wait(), PROGRESS_PERIOD)
    return interrupted.is_set()
