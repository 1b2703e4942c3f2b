"""Processes of a test: started, read and ended, each by its own id and in bounded time.

Output goes to files, so that no pipe can fill and everything a process said is still there to be
shown when a test fails.  A program that is not installed skips the test, except where `CI` is set:
there it must be present, and its absence is a failure.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import pytest

from tests.support.forked import POSSIBLE, Forked
from tests.support.process import GATEWAY

PAUSE, LONGEST_PAUSE = 0.02, 0.2
"""Seconds between two looks at something that is waited for: a tenth of the time waited so far, within these."""
PATIENCE = 120.0
"""Seconds for what must happen sooner or later, however loaded the computer is: only a failing test waits so long."""


def requires(*programs: str) -> None:
    """Skip the test, or fail it where `CI` is set, when one of these programs is not installed."""
    missing = [program for program in programs if shutil.which(program) is None]
    if not missing:
        return
    reason = f"not installed: {', '.join(missing)}"
    if os.environ.get("CI"):
        pytest.fail(reason)
    pytest.skip(reason)


def wait_until(what: str, happened: Callable[[], bool], seconds: float = PATIENCE) -> None:
    """Look again and again until `happened()` is true; fail after `seconds`."""
    began = time.monotonic()
    while not happened():
        waited = time.monotonic() - began
        if waited > seconds:
            pytest.fail(f"{what}: not within {seconds:g} s")
        time.sleep(min(max(PAUSE, waited / 10.0), LONGEST_PAUSE))


def free_port() -> int:
    """A TCP port of this machine that nobody holds, and that the system, which gives out higher ones, gives nobody."""
    while True:
        port = random.SystemRandom().randrange(20_000, 32_000)
        with socket.socket() as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


def accepts(port: int) -> bool:
    """Whether something listens on this TCP port of this machine."""
    try:
        socket.create_connection(("127.0.0.1", port), timeout=PATIENCE).close()
    except OSError:
        return False
    return True


class Process:
    """One running program; `output()` is all it has written so far, standard error included.

    The product is forked, if possible, from a process that has loaded it.
    """

    def __init__(self, argv: Sequence[str], log: Path, environment: Mapping[str, str] | None = None) -> None:
        self.argv = list(argv)
        self.log = log
        with log.open("wb") as sink:
            self._process: Forked | subprocess.Popen[bytes] = (
                Forked(*self.argv[len(GATEWAY) :], sink=sink.fileno(), **(environment or {}))
                if self.argv[: len(GATEWAY)] == GATEWAY and POSSIBLE
                else subprocess.Popen(
                    self.argv,
                    stdin=subprocess.DEVNULL,
                    stdout=sink,
                    stderr=subprocess.STDOUT,
                    env={**os.environ, **(environment or {})},
                    start_new_session=True,
                )
            )

    def output(self) -> str:
        return self.log.read_text(errors="replace")

    def running(self) -> bool:
        return self._process.poll() is None

    def whole_lines(self, start: str) -> list[str]:
        """The finished lines of the output that begin with `start`."""
        finished, _, _ = self.output().rpartition("\n")
        return [line for line in finished.splitlines() if line.startswith(start)]

    def wait_for_lines(self, start: str, count: int) -> list[str]:
        """The first `count` lines beginning with `start`; fails at once when the program ends."""

        def happened() -> bool:
            if not self.running() and len(self.whole_lines(start)) < count:
                pytest.fail(f"{self} ended early:\n{self.output()}")
            return len(self.whole_lines(start)) >= count

        wait_until(f"{count} lines '{start}…' from {self}", happened)
        return self.whole_lines(start)[:count]

    def signal(self, number: int) -> None:
        """Send it a signal."""
        self._process.send_signal(number)

    def end(self) -> int:
        """Ask the program to end (SIGTERM); kill it when it does not. The exit status."""
        if self.running():
            self._process.terminate()
        try:
            return self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait(PATIENCE)
        finally:
            # What it has started is in its session: a driver whose server has gone would run on for ever.
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)

    def __str__(self) -> str:
        return " ".join(self.argv)


class Workshop:
    """Everything one test has started or opened; all of it ends, in the opposite order, with the test."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._started: list[tuple[Process, bool]] = []
        self._open = ExitStack()

    def keep(self, close: Callable[[], None]) -> None:
        """Call this when the test is over, before any process is ended."""
        self._open.callback(close)

    def start(
        self, argv: Sequence[str], environment: Mapping[str, str] | None = None, *, ends_well: bool = False
    ) -> Process:
        """Start a program. `ends_well`: after SIGTERM its exit status has to be 0."""
        log = self.folder / f"{len(self._started):02d}-{Path(argv[0]).name}.log"
        process = Process(argv, log, environment)
        self._started.append((process, ends_well))
        return process

    def close(self) -> list[str]:
        """End what still runs, print what everything said, return what ended badly."""
        self._open.close()
        faults = []
        for process, ends_well in reversed(self._started):
            died = not process.running()
            status = process.end()
            print(f"--- {process} (status {status})\n{process.output()}")
            if ends_well and (died or status != 0):
                faults.append(f"{process}: {'died by itself, ' if died else ''}exit status {status}")
        self._started.clear()
        return faults


@contextmanager
def workshop_in(folder: Path) -> Iterator[Workshop]:
    """A workshop whose processes end with the block, however that ends; then none of them may have ended badly."""
    shop = Workshop(folder)
    try:
        yield shop
    finally:
        faults = shop.close()
    assert not faults, faults
