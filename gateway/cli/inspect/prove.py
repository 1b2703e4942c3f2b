"""``prove``: a guided check of the mount that is really there, in the terminal.

Lines have at most 60 columns, and every answer is one key, so that it can be used through ssh on a phone. The space bar
stops the mount at any time. The gateway runs meanwhile as ``run`` runs it: its page shows the mount and can stop it.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.command_line import Commands
from gateway.cli.inspect.prove_terminal import Terminal
from gateway.cli.serve.settings import add_settings, settings
from gateway.core.errors import UserError

if TYPE_CHECKING:
    from gateway.app.config import Config
    from gateway.app.gateway import Gateway
    from gateway.diagnostics.prove.findings import Findings

#: Degrees from the Sun that the check keeps by day.
SUN = 40.0
#: How many findings are shown at the end.
SHOWN = 8
EXAMPLES = """\
Examples:
  mount-gateway prove --mount nexstar@/dev/ttyUSB0
  mount-gateway prove gateway.toml
  mount-gateway prove --mount nexstar@sim      to see what it does, without a mount
"""


def add_prove(commands: Commands) -> None:
    prove = commands.add_parser(
        "prove",
        description="Leads through a check of the mount, in about nine minutes: it asks before anything moves, "
        "and the space bar stops everything. It takes every flag of run, too: mount-gateway run --help lists them. "
        "It never syncs, parks or changes a setting.",
        epilog=EXAMPLES,
    )
    prove.add_argument("--folder", type=Path, default=Path("prove"), help="where it keeps what it has found")
    own = len(prove._actions)
    add_settings(prove)
    prove.elsewhere = [action for action in prove._actions[own:] if action.dest not in ("mount", "config", "file")]
    prove.set_defaults(run=_prove)


def _prove(arguments: argparse.Namespace) -> int:
    from gateway.app.config import parse_endpoint
    from gateway.app.state.mount_claim import MountTaken
    from gateway.cli.serve.serving import make_watchdog, serve_mounts, with_loop
    from gateway.diagnostics.prove.findings import load, save, write
    from gateway.diagnostics.prove.guide import Guide

    config, source = settings(arguments, served=False)
    if not sys.stdin.isatty():
        raise UserError("prove asks questions: start it in a terminal")
    folder: Path = arguments.folder
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder}: {error.strerror}; --folder names another one") from None
    kept, terminal = folder / "findings.json", Terminal()
    over = False  # True if a person has ended it, not a signal

    async def guest(gateway: Gateway) -> None:
        nonlocal over
        await gateway.controller.settled.wait()  # then what is said of the mount comes before the first question
        with terminal.open():
            await Guide(gateway, terminal, load(kept), lambda found: save(kept, found)).run()
        over = True

    here = checked(config)
    [mount] = here.mount
    serve = partial(serve_mounts, here, watchdog=make_watchdog(here), guest=guest, screen=terminal)
    try:
        code = with_loop(False, serve)
    except MountTaken as taken:
        raise UserError(
            f"another mount-gateway ({taken.by}) has this mount: end it first (Ctrl-C in its terminal), then "
            "type this command again"
        ) from None
    if (findings := load(kept)).stages:
        for line in summary(findings):
            terminal.say(line)
        path = write(folder, findings, simulated=parse_endpoint(mount.at).where == "sim")
        terminal.say(f"Wrote {path}: verdicts and measured values, no place and no time.")
        terminal.say("Please send it to whoever gave you mount-gateway.")
    if over and findings.keys:
        asyncio.run(_offer_keys(findings, Path(source.name) if source.is_file else None, terminal))
    return code


async def _offer_keys(findings: Findings, file: Path | None, terminal: Terminal) -> None:
    """Show the lines of gateway.toml that adapt the gateway to what differs, and write them if that is wished."""
    from gateway.diagnostics.prove.adapting import adapted

    with terminal.open():
        terminal.say("These lines under [mount] of gateway.toml adapt the gateway to it:")
        text, changes = adapted(file, findings.keys)
        for line in changes:
            terminal.say(line)
        if file and text and await terminal.agrees(f"y: write them to {file}  n: do not"):
            file.write_text(text, "utf-8")


def checked(config: Config) -> Config:
    """Return the configuration of the check: one mount, far from the Sun, with surfaces for the programs of the check.

    Raises UserError if there are several mounts.
    """
    from msgspec.structs import replace

    from gateway.app.config import SurfaceConfig
    from gateway.protocols.registry import mounts, streams
    from gateway.transport.listening import SERVED

    if len(config.mount) != 1:
        raise UserError("prove checks one mount: name it with --mount PROTOCOL@WHERE")
    mount = replace(config.mount[0], sun=max(SUN, config.mount[0].sun))
    inside = [SurfaceConfig(at=f"{protocol}@{SERVED}") for protocol in mounts() if protocol in streams()]
    return replace(config, mount=[mount], surface=[*config.surface, *inside], status=False, log=False, wait=False)


def summary(findings: Findings) -> Iterator[str]:
    """Yield how many things are the same, and those that are not, what differs first, as far as they fit a screen."""
    from gateway.diagnostics.prove.findings import DIFFERS, NOT_MEASURABLE, NOT_TRIED, SAME
    from gateway.diagnostics.prove.guide import STAGES

    counts = [f"{len(findings.of(verdict))} {verdict}" for verdict in (SAME, DIFFERS, NOT_MEASURABLE, NOT_TRIED)]
    yield f"Your mount beside what the gateway assumed: {', '.join(counts)}."
    others = [one for verdict in (DIFFERS, NOT_MEASURABLE, NOT_TRIED) for one in findings.of(verdict)]
    yield from (finding.line for finding in others[:SHOWN])
    if len(others) > SHOWN:
        yield f"{len(others) - SHOWN} others are in findings.json."
    if left := [stage.name for stage in STAGES if not findings.whole(stage.name) and stage.name != "place"]:
        yield f"Not done: {', '.join(left)}. The same command goes on from there."
