"""Product processes: started, listened to, ended; and a client of one.

``tests/conftest.py`` ends whatever a test has started and, having failed, not ended.
"""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from pathlib import Path

from tests.support.forked import POSSIBLE, Forked

#: The product as a user starts it, and one that never loads astropy: that is more work than all else of its start.
WHOLE = [sys.executable, "-bb", "-m", "gateway"]
GATEWAY = [sys.executable, "-bb", "-P", str(Path(__file__).with_name("mount-gateway"))]
PATIENCE = 20.0
#: Those that have been started and not ended yet.
ALIVE: list[Running] = []


class Running:
    """A product process whose stdout is read line by line. ``said`` is its stderr, once it has ended.

    Without anything that starts it (``by``) it is forked, where that is possible, from one that has loaded the product;
    one that ``hangs`` is blocked for so many seconds by SIGUSR1.
    """

    said = ""

    def __init__(self, *arguments: str, by: list[str] | None = None, hangs: float = 0.0) -> None:
        if arguments[:1] in (("run",), ("demo",)) and "--console" not in arguments:
            arguments = (*arguments, "--no-console")  # a web server that the test does not ask for takes its time
        forked = by is None and POSSIBLE
        self.process = Forked(*arguments, hangs=hangs) if forked else started(*(by or GATEWAY), *arguments)
        ALIVE.append(self)

    def ready(self) -> str:
        """The WHERE of the next ready line."""
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

    def told(self, number: int | None = None) -> subprocess.CompletedProcess[str]:
        """What else it says and how it ends: of itself, or by this signal."""
        if number is not None:
            self.process.send_signal(number)
        assert self.process.stdout is not None
        out = self.process.stdout.read()
        self.process.wait(PATIENCE)
        code = self.end()
        return subprocess.CompletedProcess((), code, out, self.said)

    def end_at_once(self) -> None:
        """Whatever it is doing, and whether it has ended already."""
        if self.process.poll() is None:
            self.process.kill()
        self.end()


def started(*words: str) -> subprocess.Popen[str]:
    """A process whose streams are pipes of text."""
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def told(*arguments: str) -> subprocess.CompletedProcess[str]:
    """What a product process says and how it ends, of one that ends by itself."""
    return Running(*arguments).told()


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
