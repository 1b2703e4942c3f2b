"""A simulated mount and a gateway in processes of their own: does the mount come to rest when the gateway dies?"""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

from tests.support.forked import POSSIBLE
from tests.support.process import PATIENCE, Running, ask

SIMULATED = {"nexstar": "nexstar:cge", "lx200": "lx200:lx200gps", "alpaca": "alpaca:german"}
#: What can happen to a gateway, as a signal; a process that is frozen or blocked continues to exist.
FAILURES = {"killed": signal.SIGKILL, "frozen": signal.SIGSTOP, "quit": signal.SIGQUIT, "blocked": signal.SIGUSR1}
#: A gateway whose event loop SIGUSR1 blocks for this many seconds; it gets no almanac (see `GATEWAY`).
BLOCKED = 5
PROGRAM = f"""
import signal, sys, time
from gateway.astro.ephemeris import keeper
from gateway.cli import main
keeper.DAYS_PER_CALCULATION = 0
signal.signal(signal.SIGQUIT, signal.SIG_DFL)  # a shell in the background has it ignored
signal.signal(signal.SIGUSR1, lambda number, frame: time.sleep({BLOCKED}))
sys.exit(main(sys.argv[1:]))
"""


class Started(Running):
    """A gateway process that can also be made to hang."""

    def __init__(self, *arguments: str) -> None:
        by = None if POSSIBLE else [sys.executable, "-bb", "-c", PROGRAM]
        super().__init__(*arguments, by=by, hangs=BLOCKED)


class Watched:
    """``kind`` is the mount's protocol, ``port`` how the gateway reaches it: ``tcp`` or ``pty``.

    ``truth`` is a file to which the simulated mount writes the true positions of its axes.
    """

    def __init__(self, started: list[Running], place: Path, kind: str, port: str, truth: Path | None = None) -> None:
        self.kind = kind
        link = f"pty:{place}/mount"
        places = ["--at", "tcp://127.0.0.1:0", *(["--at", link] if port == "pty" else [])]
        self.sim = Running("sim", SIMULATED[kind], *places, *(["--truth", str(truth)] if truth else []))
        started.append(self.sim)
        self.mount = self.sim.ready()
        scheme = "http" if kind == "alpaca" else "socket"
        where = self.mount.replace("tcp", scheme) if port == "tcp" else self.sim.ready().removeprefix("pty:")
        self.arguments = (
            "run",
            "--mount",
            f"{kind}@{where}",
            "--surface",
            "lx200@tcp://127.0.0.1:0",
            "--state",
            str(place),
            "--sun",
            "0",
        )
        self.started = started
        self.begin()

    def begin(self) -> None:
        self.gateway = Started(*self.arguments)
        self.started.append(self.gateway)
        self.where = self.gateway.ready()

    def declination(self) -> float:
        """Return the declination that the mount reports, degrees."""
        if self.kind == "nexstar":
            return int(ask(self.mount, b"e")[9:17], 16) / 2**32 * 360.0
        if self.kind == "alpaca":
            return float(ask(self.mount, b"get declination\n", b"\n"))
        told = ask(self.mount, b":GD#").decode("latin-1")
        return float(told[0] + "1") * (int(told[1:3]) + int(told[4:6]) / 60 + int(told[7:9]) / 3600)

    def speed(self) -> float:
        """Return degrees a second, measured over a fifth of a second."""
        began, before = time.monotonic(), self.declination()
        time.sleep(0.2)
        after, ended = self.declination(), time.monotonic()
        return abs((after - before + 180.0) % 360.0 - 180.0) / (ended - began)

    def move(self) -> None:
        """Move south by direction key at the fastest rate, until the mount moves."""
        deadline = time.monotonic() + PATIENCE
        ask(self.where, b":RS#:Ms#:GVP#")
        while self.speed() < 1.0:
            assert time.monotonic() < deadline
            ask(self.where, b":RS#:Ms#:GVP#")  # a gateway that has just recovered stops the mount first

    def inflict(self, failure: str) -> float:
        """Send the signal to the gateway; return the seconds until the mount was at rest, too long by up to 0.2."""
        began = time.monotonic()
        self.gateway.process.send_signal(FAILURES[failure])
        while self.speed() > 0.05:
            assert time.monotonic() - began < PATIENCE, "the mount still moves"
        return time.monotonic() - began

    def watchdog(self, other: int | None = None) -> int:
        """Wait for this gateway's watchdog, which is started a moment after its port, and return its process id.

        ``other`` is one that has been killed.
        """
        deadline = time.monotonic() + PATIENCE
        while (found := self._watchdog()) in (None, other):
            assert time.monotonic() < deadline, "there is no watchdog"
            time.sleep(0.02)
        assert found is not None
        return found

    def _watchdog(self) -> int | None:
        for path in Path("/proc").glob("[0-9]*"):
            try:
                words: list[Any] = (path / "cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            gateway = str(self.gateway.process.pid).encode()
            if len(words) > 5 and words[3].endswith(b"watchdog/process.py") and words[5] == gateway:
                return int(path.name)
        return None

    def close(self) -> None:
        """End the gateway and its watchdog at once, without their repeated stops."""
        watchdog = self._watchdog()
        for number in (watchdog, self.gateway.process.pid):
            if number is not None and (number == watchdog or self.gateway.process.poll() is None):
                os.kill(number, signal.SIGKILL)

    def tracks(self) -> bool:
        """Whether the mount reports that it tracks; an LX200GPS does so by its alignment letters."""
        if self.kind == "nexstar":
            return ask(self.mount, b"t") == b"\x02#"
        if self.kind == "alpaca":
            return ask(self.mount, b"get tracking\n", b"\n") == b"true\n"
        return b"T" in ask(self.mount, b":GW#:GVP#")[:3]
