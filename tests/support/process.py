"""Product processes: how to start them, read them and end them; and a client of one.

``tests/conftest.py`` ends the processes that a failing test has left running.
"""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from pathlib import Path

from tests.support.forked import PATIENCE, POSSIBLE, Forked

#: The product as a user starts it, and without a process that calculates the almanac, which takes longer than a start.
WHOLE = [sys.executable, "-bb", "-m", "gateway"]
#: The product, for an almanac that gives way to nothing: at the lowest priority it takes minutes beside other tests.
EAGER = [sys.executable, "-bb", "-c", "import os, sys; os.nice = int; from gateway.cli import main; sys.exit(main())"]
GATEWAY = [sys.executable, "-bb", "-P", str(Path(__file__).with_name("mount-gateway"))]
#: The processes that have been started and have not been ended yet.
ALIVE: list[Running] = []


class Running:
    """A product process whose stdout is read line by line; ``said`` is its stderr once it has ended.

    Unless ``by`` is the command that starts it, it is forked, if possible, from a process that has loaded the package.
    SIGUSR1 blocks it for ``hangs`` seconds.
    """

    said = ""

    def __init__(self, *arguments: str, by: list[str] | None = None, hangs: float = 0.0) -> None:
        if arguments[:1] in (("run",), ("demo",)) and "--console" not in arguments:
            arguments = (*arguments, "--no-console")  # a web server that the test does not use costs time
        forked = by is None and POSSIBLE
        self.process = Forked(*arguments, hangs=hangs) if forked else started(*(by or GATEWAY), *arguments)
        ALIVE.append(self)

    def ready(self) -> str:
        """Return the WHERE of the next ready line. Raises AssertionError if the process ends before."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line.startswith("ready "):
                return line.strip().partition("@")[2]
        assert self.process.stderr is not None
        raise AssertionError(f"ended early: {self.process.stderr.read()}")

    def end(self, number: int = signal.SIGTERM) -> int:
        if self.process.poll() is None:
            self.process.send_signal(number)
        code = self.process.wait(PATIENCE)
        if self.process.stderr is not None and not self.process.stderr.closed:
            self.said = self.process.stderr.read().strip()
        for stream in (self.process.stdout, self.process.stderr):
            assert stream is not None
            stream.close()
        if self in ALIVE:
            ALIVE.remove(self)
        return code

    def finish(self, number: int | None = None) -> subprocess.CompletedProcess[str]:
        """Read the rest of the output until the process ends, by itself or by this signal."""
        if number is not None:
            self.process.send_signal(number)
        assert self.process.stdout is not None
        out = self.process.stdout.read()
        self.process.wait(PATIENCE)
        code = self.end()
        return subprocess.CompletedProcess((), code, out, self.said)

    def end_at_once(self) -> None:
        """Kill the process if it still runs, and close its streams."""
        if self.process.poll() is None:
            self.process.kill()
        self.end()


def started(*words: str) -> subprocess.Popen[str]:
    """Start a process whose streams are text pipes."""
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def run_to_end(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a product process that ends by itself; return its output and exit code."""
    return Running(*arguments).finish()


def ask(where: str, data: bytes, until: bytes = b"#") -> bytes:
    host, _, port = where.removeprefix("tcp://").rpartition(":")
    with socket.create_connection((host, int(port)), PATIENCE) as link:
        link.settimeout(PATIENCE)
        link.sendall(data)
        heard = b""
        while not heard.endswith(until):
            piece = link.recv(100)
            if not piece:
                break
            heard += piece
        return heard
