"""``prove``: a guided check of the connected mount, in the terminal.

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
from gateway.cli.serve.settings import add_setting_flags, load_config
from gateway.core.errors import UserError

if TYPE_CHECKING:
    from gateway.app.config import Config
    from gateway.app.gateway import Gateway
    from gateway.diagnostics.prove.findings import Findings


import contextlib
import textwrap

from gateway.cli.serve.live import Screen

#: Columns of a line, and of the progress bar in it.
LINE_COLUMNS, BAR_COLUMNS = 60, 14
#: Seconds between two checks for a pressed key on Windows, where the event loop cannot wait for the keyboard.
KEYBOARD_POLL_PERIOD = 0.05


class CheckTerminal(Screen):
    """The terminal of the check: prints narrow lines, also those of the gateway, and reads one key at a time."""

    def __init__(self) -> None:
        super().__init__(None)
        self.stop = asyncio.Event()
        self._keys: asyncio.Queue[str] = asyncio.Queue()
        self._bar_length, self._is_asking = 0, False
        #: Whether q was pressed while no question was open: the next question is then answered with q.
        self._wants_to_leave = False

    @contextlib.contextmanager
    def open(self) -> Iterator[CheckTerminal]:
        """Read single keys while the block lasts."""
        self.stop, self._keys = asyncio.Event(), asyncio.Queue()  # of this event loop
        if sys.platform == "win32":
            poll = asyncio.ensure_future(self._poll_keyboard())
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
        loop.add_reader(number, self._read_keys)
        try:
            yield self
        finally:
            loop.remove_reader(number)
            with contextlib.suppress(termios.error):  # the terminal was closed
                termios.tcsetattr(number, termios.TCSADRAIN, before)

    def _read_keys(self) -> None:
        import os

        try:
            text = os.read(sys.stdin.fileno(), 64).decode("ascii", "ignore")
        except OSError:
            text = ""
        if not text:  # the terminal is gone; SIGHUP ends the process
            asyncio.get_running_loop().remove_reader(sys.stdin.fileno())
        for key in text:
            self.on_key(key)

    async def _poll_keyboard(self) -> None:
        import msvcrt

        while True:
            while msvcrt.kbhit():  # type: ignore[attr-defined,unused-ignore]
                self.on_key(msvcrt.getwch())  # type: ignore[attr-defined,unused-ignore]
            await asyncio.sleep(KEYBOARD_POLL_PERIOD)

    def on_key(self, key: str) -> None:
        leaves = key in "qQ" and not self._is_asking
        self._wants_to_leave |= leaves
        if key == " " or leaves:  # whoever wants to leave in the middle wants it to stop
            self.stop.set()
        self._keys.put_nowait(key.lower())

    def say(self, text: str) -> None:
        """Print lines of at most 60 columns."""
        indent = " " * (len(text) - len(text.lstrip()))
        self._print("\n".join(textwrap.wrap(text, LINE_COLUMNS, subsequent_indent=f"{indent}  ")) + "\n")

    warn = say

    def show_progress(self, fraction: float, title: str) -> None:
        """Show how far this stage of the check has come (``fraction``, 0 to 1), below the last line."""
        done = round(BAR_COLUMNS * fraction)
        line = f"[{'#' * done}{'.' * (BAR_COLUMNS - done)}] {title}"[: LINE_COLUMNS - 1]
        self._print(f"{line}\r")
        self._bar_length = len(line)

    def _print(self, text: str) -> None:
        """Print below an open question, or over the progress bar. Errors are ignored: they must not prevent a stop."""
        before = " " * self._bar_length + "\r" if self._bar_length else "\n" * self._is_asking
        self._bar_length, self._is_asking = 0, False
        with contextlib.suppress(OSError, ValueError):
            print(before + text, end="", flush=True)

    async def ask_for_key(self, question: str, keys: str) -> str:
        """Repeat the question until one of ``keys`` is pressed; return that key. Return a blank if the space bar has
        stopped the mount, and q if q was pressed before the question; other earlier keys are ignored.
        """
        while not self._keys.empty():
            self._keys.get_nowait()
        while not self.stop.is_set():
            if self._wants_to_leave:
                self._wants_to_leave = False
                return "q"
            self._print(f"{textwrap.fill(question, LINE_COLUMNS - 4)} > ")
            self._is_asking = True
            if (key := await self._keys.get()) in keys:
                self._is_asking = False
                self._print(f"{key}\n")
                return key
        return " "


#: Minimum distance between tube and Sun during the check by day, degrees, unless the user has set more.
MIN_SUN_DISTANCE = 40.0
#: How many findings are shown at the end.
MAX_SHOWN_FINDINGS = 8
EXAMPLES = """\
Examples:
  mount-gateway prove --mount nexstar@/dev/ttyUSB0
  mount-gateway prove gateway.toml
  mount-gateway prove --mount nexstar@sim      to see what it does, without a mount
"""


def add_prove(commands: Commands) -> None:
    prove = commands.add_parser(
        "prove",
        description="Checks the mount with you, in about nine minutes. It asks before anything moves, and the space "
        "bar stops everything. It takes every flag of run, too: mount-gateway run --help lists them. "
        "It never syncs, parks or changes a setting.",
        epilog=EXAMPLES,
    )
    prove.add_argument("--folder", type=Path, default=Path("prove"), help="folder for the results")
    before = len(prove._actions)
    add_setting_flags(prove)
    prove.suppressed_actions = [
        action for action in prove._actions[before:] if action.dest not in ("mount", "config", "file")
    ]
    prove.set_defaults(run=_run_prove)


def _run_prove(arguments: argparse.Namespace) -> int:
    from gateway.app.config import parse_endpoint
    from gateway.app.config.showing import to_toml
    from gateway.app.state.mount_claim import MountTaken
    from gateway.cli.serve.serving import make_watchdog, run_on_loop, serve_mounts
    from gateway.diagnostics.prove.findings import load, save, write_proof_file
    from gateway.diagnostics.prove.guide import GuidedCheck

    config, _ = load_config(arguments, needs_surfaces=False)
    if not sys.stdin.isatty():
        raise UserError("prove asks questions: start it in a terminal")
    folder: Path = arguments.folder
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder}: {error.strerror}; --folder names another one") from None
    findings_file, terminal = folder / "findings.json", CheckTerminal()
    over = False  # True if a person has ended it, not a signal

    async def check(gateway: Gateway) -> None:
        nonlocal over
        await gateway.controller.site_read.wait()  # then what is said of the mount comes before the first question
        with terminal.open():
            await GuidedCheck(
                gateway, terminal, load(findings_file), lambda findings: save(findings_file, findings)
            ).run()
        over = True

    checked_config = config_for_check(config)
    [mount] = checked_config.mount
    serve = partial(serve_mounts, checked_config, watchdog=make_watchdog(checked_config), job=check, screen=terminal)
    try:
        code = run_on_loop(False, serve)
    except MountTaken as taken:
        raise UserError(
            f"another mount-gateway ({taken.holder}) has this mount: end it first (Ctrl-C in its terminal), then "
            "type this command again"
        ) from None
    if (findings := load(findings_file)).stages:
        for line in summarize(findings):
            terminal.say(line)
        path = write_proof_file(folder, findings, simulated=parse_endpoint(mount.at).where == "sim")
        terminal.say(f"Wrote {path}: verdicts and measured values, no place and no time.")
        terminal.say("Please send it to whoever gave you mount-gateway.")
    if over and findings.config_keys:
        terminal.say("These lines under [mount] of gateway.toml adapt the gateway to it:")
        for key, value in findings.config_keys.items():
            terminal.say(f"{key} = {to_toml(value)}")
    return code


def config_for_check(config: Config) -> Config:
    """Return the configuration for the check: ``MIN_SUN_DISTANCE`` or more from the Sun, no status line, no log,
    ``--no-wait``. Raises UserError if there are several mounts.
    """
    from msgspec.structs import replace

    if len(config.mount) != 1:
        raise UserError("prove checks one mount: name it with --mount PROTOCOL@WHERE")
    mount = replace(config.mount[0], sun=max(MIN_SUN_DISTANCE, config.mount[0].sun))
    return replace(config, mount=[mount], status=False, log=False, wait=False)


def summarize(findings: Findings) -> Iterator[str]:
    """Yield lines for the user: the number of findings by verdict, the first that are not ``SAME``, the stages left."""
    from gateway.diagnostics.prove.findings import DIFFERS, NOT_MEASURABLE, NOT_TRIED, SAME
    from gateway.diagnostics.prove.guide import STAGES

    counts = [f"{len(findings.select(verdict))} {verdict}" for verdict in (SAME, DIFFERS, NOT_MEASURABLE, NOT_TRIED)]
    yield f"Your mount beside what the gateway assumed: {', '.join(counts)}."
    others = [item for verdict in (DIFFERS, NOT_MEASURABLE, NOT_TRIED) for item in findings.select(verdict)]
    yield from (finding.as_line for finding in others[:MAX_SHOWN_FINDINGS])
    if len(others) > MAX_SHOWN_FINDINGS:
        yield f"{len(others) - MAX_SHOWN_FINDINGS} others are in findings.json."
    if left := [stage.name for stage in STAGES if not findings.is_complete(stage.name) and stage.name != "place"]:
        yield f"Not done: {', '.join(left)}. The same command continues from there."
