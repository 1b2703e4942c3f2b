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
    from gateway.diagnostics.prove.guide import Stage

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
    prove.add_argument(
        "--folder", type=Path, default=Path("prove"), help="where it keeps what it has found, and its recordings"
    )
    own = len(prove._actions)
    add_settings(prove)
    prove.elsewhere = [action for action in prove._actions[own:] if action.dest not in ("mount", "config", "file")]
    prove.set_defaults(run=_prove)


def _prove(arguments: argparse.Namespace) -> int:
    from gateway.app.state.mount_claim import MountTaken
    from gateway.cli.serve.serving import make_watchdog, serve_mounts, with_loop
    from gateway.diagnostics.prove.findings import load, save
    from gateway.diagnostics.prove.guide import LOOKING, MOVING, Guide

    config, source = settings(arguments, served=False)
    if not sys.stdin.isatty():
        raise UserError("prove asks questions: start it in a terminal")
    folder: Path = arguments.folder
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder}: {error.strerror}; --folder names another one") from None
    kept, terminal = folder / "findings.json", Terminal()
    going: bool | None = True  # False after q, None after a signal
    moved = False
    code = 0
    for stages in (LOOKING, MOVING):  # apart, because a bundle holds nothing of the first

        async def guest(gateway: Gateway, stages: tuple[Stage, ...] = stages) -> None:
            nonlocal going, moved
            await gateway.controller.settled.wait()  # then what is said of the mount comes before the first question
            with terminal.open():
                guide = Guide(gateway, terminal, load(kept), lambda found: save(kept, found), stages)
                try:
                    await guide.run()
                finally:
                    moved = guide.moved
                going = not guide.left
                if going and stages is LOOKING:
                    terminal.say("From here on, what passes on the line is recorded for the file.")
                    terminal.between = True

        if going:
            going = None
            here = checked(config, folder, record=stages is MOVING)
            serve = partial(serve_mounts, here, watchdog=make_watchdog(here), guest=guest, screen=terminal)
            try:
                code = with_loop(False, serve, stages is MOVING)
            except MountTaken as taken:
                raise UserError(
                    f"another mount-gateway ({taken.by}) has this mount: end it first (Ctrl-C in its terminal), then "
                    "type this command again"
                ) from None
            record = here.mount[0].record
            for path in folder.glob(f"{Path(record).name}*") if record and not moved else ():
                path.unlink()  # nothing but the beginning of a session is in it
    terminal.between, findings = False, load(kept)
    if going is None:
        for line in summary(findings):
            terminal.say(line)
    elif findings.stages:
        asyncio.run(_afterwards(findings, Path(source.name) if source.is_file else None, folder, terminal))
    return code


async def _afterwards(findings: Findings, file: Path | None, folder: Path, terminal: Terminal) -> None:
    """Show what was found, and offer what follows from it: lines for gateway.toml, and a file for the authors."""
    from gateway.diagnostics.prove import bundle
    from gateway.diagnostics.prove.adapting import adapted

    with terminal.open():
        for line in summary(findings):
            terminal.say(line)
        if findings.keys:
            terminal.say("These lines under [mount] of gateway.toml adapt the gateway to it:")
            text, changes = adapted(file, findings.keys)
            for line in changes:
                terminal.say(line)
            if file and text and await terminal.agrees(f"y: write them to {file}  n: do not"):
                file.write_text(text, "utf-8")
        if not recordings(folder):
            terminal.say("No file yet: it needs one of the stages place to program.")
            return
        if not await terminal.agrees("y: make a file for whoever gave you mount-gateway  n: end"):
            return
        terminal.say("Making it takes some seconds …")
        try:
            files = await asyncio.to_thread(bundle.make, findings, recordings(folder))
        except UserError as error:
            terminal.say(f"No file can be made: {error}.")
            return
        (inside := folder / "to-send").mkdir(exist_ok=True)
        for name, data in files.items():
            (inside / name).write_bytes(data)
            terminal.say(f"{inside / name}: {len(data.splitlines())} lines")
        terminal.say(
            "That is all of it: look into it. There is no name or address in it; longitude and hours are others, the "
            "date is the true one. An alt-az mount's motions may tell the latitude, and who knows when you made the "
            "check the longitude."
        )
        terminal.say(f"To read it: mount-gateway decode {inside / '1.rec'}")
        path = bundle.unused(bundle.name_of(findings))
        if await terminal.agrees(f"y: save it as {path}  n: do not"):
            bundle.save(path, files)
            terminal.say(f"Saved {path}. Please send it to whoever gave you mount-gateway.")


def checked(config: Config, folder: Path, record: bool) -> Config:
    """Return the configuration of the check: one mount, far from the Sun, with surfaces for the programs of the check.

    Raises UserError if there are several mounts.
    """
    from msgspec.structs import replace

    from gateway.app.config import SurfaceConfig
    from gateway.protocols.registry import mounts, streams
    from gateway.transport.listening import SERVED

    if len(config.mount) != 1:
        raise UserError("prove checks one mount: name it with --mount PROTOCOL@WHERE")
    path = str(folder / f"{len(recordings(folder)) + 1}.rec") if record else None
    mount = replace(config.mount[0], sun=max(SUN, config.mount[0].sun), record=path)
    inside = [SurfaceConfig(at=f"{protocol}@{SERVED}") for protocol in mounts() if protocol in streams()]
    return replace(config, mount=[mount], surface=[*config.surface, *inside], status=False, log=False, wait=False)


def recordings(folder: Path) -> list[Path]:
    """Return the recordings of the sessions so far."""
    return sorted(folder.glob("*.rec"), key=lambda path: (len(path.name), path.name))


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
