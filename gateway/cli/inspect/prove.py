"""``prove``: a guided check of the mount that is really there, in the terminal.

Lines have at most 60 columns, and every answer is one key, so that it can be used through ssh on a phone. The space bar
stops the mount at any time. The gateway runs meanwhile as ``run`` runs it: its page shows the mount and can stop it.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.command_line import EXIT_CODES, Commands, endpoints
from gateway.cli.serve.settings import add_settings, settings
from gateway.core.errors import UserError

if TYPE_CHECKING:
    from gateway.app.config import Config
    from gateway.app.gateway import Gateway
    from gateway.diagnostics.prove.findings import Findings

#: Columns of a line, and of the progress bar in it.
COLUMNS, BAR = 60, 14
#: Degrees from the Sun that the check keeps by day.
SUN = 40.0
#: Seconds between two looks at the keyboard, where the event loop cannot wait for it.
EVERY = 0.05
EXAMPLES = """\
Examples:
  mount-gateway prove --mount nexstar@/dev/ttyUSB0
  mount-gateway prove gateway.toml
  mount-gateway prove --mount nexstar@sim      to see what it does, without a mount
"""


def add_prove(commands: Commands) -> None:
    prove = commands.add_parser(
        "prove",
        description="Leads through a check of the mount, which takes about ten minutes: it asks before anything moves, "
        "and the space bar stops everything. It takes every flag of run, too: mount-gateway run --help lists them. "
        "It never syncs, parks or changes a setting.",
        late=lambda: f"{EXAMPLES}\n{endpoints()}\n\n{EXIT_CODES}",
    )
    prove.add_argument(
        "--folder", type=Path, default=Path("prove"), help="where it keeps what it has found, and its recordings"
    )
    own = len(prove._actions)
    add_settings(prove)
    prove.elsewhere = [action for action in prove._actions[own:] if action.dest not in ("mount", "config", "file")]
    prove.set_defaults(run=_prove)


def _prove(arguments: argparse.Namespace) -> int:
    from gateway.cli.serve.serving import serve_mounts, start_watchdog, with_loop
    from gateway.diagnostics.prove.findings import load, save
    from gateway.diagnostics.prove.guide import Guide

    config, _ = settings(arguments, served=False)
    if not sys.stdin.isatty():
        raise UserError("prove asks questions: start it in a terminal")
    folder: Path = arguments.folder
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder}: {error.strerror}; --folder names another one") from None
    kept = folder / "findings.json"
    config = checked(config, folder)
    watchdog = start_watchdog(config)

    async def guest(gateway: Gateway) -> None:
        with Terminal().open() as terminal:
            findings = await Guide(gateway, terminal, load(kept), lambda found: save(kept, found)).run()
            for line in summary(findings):
                terminal.say(line)

    return with_loop(False, lambda: serve_mounts(config, watchdog=watchdog, guest=guest), recorded=True)


def checked(config: Config, folder: Path) -> Config:
    """Return the configuration of the check: one mount, recorded, far from the Sun, with surfaces for its programs.

    Raises UserError if there are several mounts.
    """
    from msgspec.structs import replace

    from gateway.app.config import SurfaceConfig
    from gateway.protocols.registry import mounts, streams
    from gateway.transport.listening import SERVED

    if len(config.mount) != 1:
        raise UserError("prove checks one mount: name it with --mount PROTOCOL@WHERE")
    number = 1 + len(list(folder.glob("*.rec")))
    mount = replace(config.mount[0], sun=max(SUN, config.mount[0].sun), record=str(folder / f"{number}.rec"))
    inside = [SurfaceConfig(at=f"{protocol}@{SERVED}") for protocol in mounts() if protocol in streams()]
    return replace(config, mount=[mount], surface=[*config.surface, *inside], status=False, log=False, wait=False)


def summary(findings: Findings) -> Iterator[str]:
    """Yield how many things are the same, and everything that is not."""
    from gateway.diagnostics.prove.findings import DIFFERS, NOT_MEASURABLE, NOT_TRIED, SAME

    counts = [f"{len(findings.of(verdict))} {verdict}" for verdict in (SAME, DIFFERS, NOT_MEASURABLE, NOT_TRIED)]
    yield f"Your mount beside what the gateway assumed: {', '.join(counts)}."
    for finding in findings.of(DIFFERS):
        yield finding.line


class Terminal:
    """The person at the terminal: prints narrow lines, and reads one key at a time."""

    def __init__(self) -> None:
        self.stop = asyncio.Event()
        self._keys: asyncio.Queue[str] = asyncio.Queue()
        self._bar = 0

    @contextlib.contextmanager
    def open(self) -> Iterator[Terminal]:
        """Read single keys while the block lasts."""
        if sys.platform == "win32":
            poll = asyncio.ensure_future(self._poll())
            try:
                yield self
            finally:
                poll.cancel()
            return
        import termios
        import tty

        loop, number = asyncio.get_running_loop(), sys.stdin.fileno()
        before = termios.tcgetattr(number)
        tty.setcbreak(number)
        loop.add_reader(number, self._read)
        try:
            yield self
        finally:
            loop.remove_reader(number)
            with contextlib.suppress(termios.error):  # the terminal was closed
                termios.tcsetattr(number, termios.TCSADRAIN, before)

    def _read(self) -> None:
        import os

        try:
            text = os.read(sys.stdin.fileno(), 64).decode("ascii", "ignore")
        except OSError:
            text = ""
        if not text:  # the terminal is gone; SIGHUP ends the process
            asyncio.get_running_loop().remove_reader(sys.stdin.fileno())
        for key in text:
            self._pressed(key)

    async def _poll(self) -> None:
        import msvcrt

        while True:
            while msvcrt.kbhit():  # type: ignore[attr-defined,unused-ignore]
                self._pressed(msvcrt.getwch())  # type: ignore[attr-defined,unused-ignore]
            await asyncio.sleep(EVERY)

    def _pressed(self, key: str) -> None:
        if key == " ":
            self.stop.set()
        else:
            self._keys.put_nowait(key.lower())

    def say(self, text: str) -> None:
        """Print lines of at most 60 columns."""
        self._clear()
        indent = " " * (len(text) - len(text.lstrip()))
        print("\n".join(textwrap.wrap(text, COLUMNS, subsequent_indent=f"{indent}  ")), flush=True)

    def progress(self, part: float, what: str) -> None:
        """Show how far the stage has come, below the last line."""
        self._clear()
        done = round(BAR * part)
        line = f"[{'#' * done}{'.' * (BAR - done)}] {what}"[: COLUMNS - 1]
        self._bar = len(line)
        print(line, end="\r", flush=True)

    def _clear(self) -> None:
        if self._bar:
            print(" " * self._bar, end="\r")
        self._bar = 0

    async def key(self, question: str, keys: str) -> str:
        """Return one of these keys; what was pressed before the question does not count."""
        self.say(question)
        while not self._keys.empty():
            self._keys.get_nowait()
        while (key := await self._keys.get()) not in keys:
            pass
        return key
