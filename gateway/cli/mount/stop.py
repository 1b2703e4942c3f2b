"""``stop``: stops every mount of this computer, even if no gateway runs. ``--hold`` also forbids motion afterwards.

It prints a line for each mount. The exit code is 0 if all mounts report positions at rest, or if there is none. It is 1
if a mount is not stopped or reports no position, or a gateway does not answer. systemd can run it as ``ExecStopPost``.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
from pathlib import Path
from typing import TextIO

from gateway.cli.command_line import Commands
from gateway.cli.mount.gateway_client import add_gateway_flags, no_such_mount_message
from gateway.core.errors import UserError, explain_os_error
from gateway.core.requests import HoldRequest, ReleaseHoldRequest, StopRequest
from gateway.system import streams

EXAMPLES = """\
Examples:
  mount-gateway stop
  mount-gateway stop --hold       stop, and let no program move a mount
  mount-gateway stop --release    let programs move the mounts again
  sudo mount-gateway stop         the mounts of other users' gateways, too
"""


def add_stop(commands: Commands) -> None:
    stop = commands.add_parser(
        "stop",
        description="Stops every mount on this computer, and watches each until it is at rest. Exit code 0: all are "
        "at rest, 1: a mount could not be stopped or watched, or a gateway could not be asked.",
        epilog=EXAMPLES,
    )  # fmt: skip
    add_gateway_flags(stop, "only this one")
    both = stop.add_mutually_exclusive_group()
    both.add_argument(
        "--hold",
        action="store_true",
        help="stop, and refuse every motion until --release, even after restarts of the gateway and the computer",
    )
    both.add_argument("--release", action="store_true", help="let programs move the mounts again")
    stop.set_defaults(run=_run_stop)


def _run_stop(arguments: argparse.Namespace) -> int:
    from gateway.app.control.reach import scope_of
    from gateway.app.control.stop_command import request_all

    request = HoldRequest() if arguments.hold else ReleaseHoldRequest() if arguments.release else StopRequest()
    word = str(request.__struct_config__.tag)
    if arguments.mount and word != "stop":
        raise UserError(f"stop --{word} is for all mounts of a state folder: leave --mount out")
    scope = scope_of(arguments.state)
    good, bad = [], []
    report = asyncio.run(request_all(scope, _normalized_endpoint(arguments.mount), request))
    for mount, answer in report.mount_answers:
        name = mount or "a mount that is no longer known"
        if answer.is_ok:
            good.append(f"{name}: {answer.text}")
        else:
            bad.append(f"{name}: {'not stopped: ' * (word == 'stop')}{answer.text}")
    if word != "stop":
        done, trouble = _store_hold(scope.folder, word)
        good += [done] * bool(done)
        bad += [trouble] * bool(trouble)
    bad += report.warnings
    if arguments.mount and report.other_mounts and not report.mount_answers:
        bad.append(f"{no_such_mount_message(arguments.mount, report.other_mounts)}. Nothing was stopped")
    if not (good or bad):
        only = f" for {arguments.mount}" if arguments.mount else ""
        good.append(NOTHING_DONE_MESSAGES[word].format(only=only))
    _print_lines(good, sys.stdout, streams.INFO)
    _print_lines(bad, sys.stderr, streams.ERROR)
    return 1 if bad else 0


def _normalized_endpoint(mount: str | None) -> str | None:
    """Return the endpoint of a mount as its gateway writes it; a text that is no endpoint is returned unchanged."""
    from gateway.app.config import parse_endpoint

    if mount is None or "@" not in mount:
        return mount
    try:
        return str(parse_endpoint(mount))
    except UserError:
        return mount


NOTHING_DONE_MESSAGES = {
    "stop": "nothing to stop: no gateway runs{only}, and none ended in motion",
    "release": "nothing to release: no gateway runs, and nothing is held",
}


def _store_hold(folder: Path, action: str) -> tuple[str, str]:
    """Write or delete the file that makes later gateways refuse motion; return a success and a failure text, or ""."""
    from gateway.app.state.file import HOLD_FILE, delete_hold_file, write_hold_file

    try:
        if action == "hold":
            write_hold_file(folder)
            return f"held: no gateway moves a mount of {folder} until mount-gateway stop --release", ""
        return (f"released: gateways may move the mounts of {folder} again" if delete_hold_file(folder) else ""), ""
    except OSError as error:
        after = (
            "a gateway started later will not hold the mount"
            if action == "hold"
            else ("a gateway that is started later is held again")
        )
        return "", f"{folder / HOLD_FILE}: {explain_os_error(error)}: {after}"


def _print_lines(lines: list[str], stream: TextIO, log_level: int) -> None:
    for line in lines:
        plain = "".join(letter if letter.isprintable() else "?" for letter in line)
        print(f"{streams.journal_prefix(log_level, stream)}{plain}", file=stream)
