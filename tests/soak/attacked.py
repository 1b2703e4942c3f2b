"""A gateway under attack: real processes, a line that can be tampered with, and a judge that cannot be deceived.

The simulated mount is of this checkout and records its true motion; the gateway is of the checkout under test. A relay
between them loses, freezes or cuts what passes. The gateway's computer has the simulated time, or any other.
``Attacked`` is one such set-up: clients send bytes, and the figures are computed from the truth alone.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import subprocess
import sys
import threading
import time
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from gateway.astro.axes import Observer
from gateway.astro.spherical import horizon_to_hour_angle, hour_angle_to_horizon, separation, wrap180, wrap360
from gateway.protocols.mechanics.truth import sun

HERE = Path(__file__).resolve().parents[2]
SITE = (45.0, 10.0)
EVENING = "2026-01-15T22:00:00+00:00"
NOON = "2026-06-21T11:00:00+00:00"
PATIENCE = 30.0
#: What requests over HTTP begin with.
HTTP = (b"GET ", b"PUT ")
#: Seconds for which the mount is watched after a stop, at most; a mount that still moves then counts as this long.
WATCHED = 20.0
#: Runs the gateway of the current directory on a computer whose clock is ahead by the first argument.
_AHEAD = ("import runpy, sys, time; real = time.time; ahead = float(sys.argv.pop(1)); "
          "time.time = lambda: real() + ahead; "
          "runpy.run_module('gateway', run_name='__main__', alter_sys=True)")  # fmt: skip


class Relay:
    """Passes everything between the gateway and the mount, except what it is ordered to lose or change."""

    def __init__(self, to: tuple[str, int]) -> None:
        self.to = to
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._server.getsockname()[1]
        self._links: list[socket.socket] = []
        self.lost: list[bytes] = []
        self._swallowed: tuple[bytes, ...] = ()
        self._times = 0
        self._cut_until = 0.0
        self._frozen: tuple[bytes, ...] = ()
        self._answers: dict[bytes, bytes] = {}
        threading.Thread(target=self._accept, daemon=True).start()

    def swallow(self, *begins: bytes, times: int = 1) -> None:
        """Lose the next commands with these beginnings."""
        self._swallowed, self._times = begins, times

    def freeze(self, *begins: bytes) -> None:
        """From now on, repeat the first reply to each request with one of these beginnings for ever."""
        self._frozen = begins

    def cut(self, seconds: float) -> None:
        """Pull the cable out for this many seconds."""
        self._cut_until = time.monotonic() + seconds
        for link in self._links:
            with contextlib.suppress(OSError):
                link.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        for link in (self._server, *self._links):
            with contextlib.suppress(OSError):
                link.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._server.accept()
                if time.monotonic() < self._cut_until:
                    near.close()
                    continue
                far = socket.create_connection(self.to, PATIENCE)
                self._links += [near, far]
                asked: list[bytes] = [b""]
                threading.Thread(target=self._pass, args=(near, far, asked, True), daemon=True).start()
                threading.Thread(target=self._pass, args=(far, near, asked, False), daemon=True).start()

    def _pass(self, source: socket.socket, to: socket.socket, asked: list[bytes], command: bool) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(4096):
                if command:
                    asked[0] = data
                    if self._times and data.startswith(self._swallowed):
                        self._times -= 1
                        self.lost.append(data)
                        if data.startswith(HTTP):  # half a request would spoil the next one: the connection breaks
                            break
                        continue
                elif self._frozen and asked[0].startswith(self._frozen):
                    data = self._answers.setdefault(asked[0], data)
                to.sendall(data)
        for link in (source, to):
            with contextlib.suppress(OSError):
                link.shutdown(socket.SHUT_RDWR)


class Program:
    """A client: one TCP connection that sends bytes, from an address of this computer."""

    def __init__(self, where: tuple[str, int], host: str = "127.0.0.1") -> None:
        self.link = socket.create_connection(where, PATIENCE, source_address=(host, 0))

    def tell(self, data: bytes) -> None:
        self.link.sendall(data)

    def ask(self, data: bytes, seconds: float = 2.0, until: bytes = b"#") -> bytes:
        """Send bytes and return the reply up to ``until``, or what arrives within this many seconds."""
        self.link.sendall(data)
        heard, end = b"", time.monotonic() + seconds
        while not heard.endswith(until) and (left := end - time.monotonic()) > 0:
            self.link.settimeout(left)
            try:
                piece = self.link.recv(4096)
            except TimeoutError:
                break
            if not piece:
                break
            heard += piece
        self.link.settimeout(PATIENCE)
        return heard

    def poll(self, seconds: float, question: bytes = b":GR#", every: float = 0.5) -> None:
        """Repeat a request for a while, as every program does."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            with contextlib.suppress(OSError):
                self.ask(question, min(every, left))
            time.sleep(max(0.0, min(every, end - time.monotonic())))

    def reset(self) -> None:
        """Disconnect as when the program is killed: with a reset."""
        self.link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        self.link.close()


class Attacked:
    """One mount with one gateway of ``tree`` in front of it."""

    def __init__(
        self,
        tree: Path,
        place: Path,
        mount: str,
        *options: str,
        surface: str = "lx200:lx200gps",
        start: str = EVENING,
        host: str = "",
        sim: tuple[str, ...] = (),
        site: tuple[float, float] = SITE,
    ) -> None:
        """``host`` is the time on the gateway's computer, if not the true one; ``site`` the true one."""
        self.mount, self._started, self.site = mount, datetime.fromisoformat(start).timestamp(), site
        self.http = mount.startswith("alpaca")
        self._truth, self._said = place / "truth.jsonl", place / "said.txt"
        self._said.touch()
        self._processes: list[subprocess.Popen[str]] = []
        self._began = 0
        self._stopped: float | None = None
        mounted = self._run(
            HERE,
            0.0,
            "sim",
            mount,
            "--at",
            "tcp://127.0.0.1:0",
            "--truth",
            str(self._truth),
            "--time",
            start,
            "--site",
            f"{site[0]:g},{site[1]:g}",
            *sim,
        )
        self.relay = Relay(mounted)
        self._gateway = (
            "run",
            "--no-console",
            "--mount",
            f"{mount.partition(':')[0]}@{'http' if self.http else 'socket'}://127.0.0.1:{self.relay.port}",
            "--surface",
            f"{surface}@tcp://127.0.0.1:0",
            "--no-discovery",
            "--no-status",
            "--state",
            str(place / "state"),
            *options,
        )
        self._tree, self._host = tree, host
        self._surface = self._start()

    def _start(self) -> tuple[str, int]:
        ahead = (datetime.fromisoformat(self._host).timestamp() if self._host else self.now) - time.time()
        return self._run(self._tree, ahead, *self._gateway)

    def restart(self) -> None:
        """End the gateway and start it again, with the same state folder."""
        process = self._processes.pop()
        process.terminate()
        process.wait(PATIENCE)
        if process.stdout is not None:
            process.stdout.close()
        self._surface = self._start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for process in reversed(self._processes):
            process.terminate()
            try:
                process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            if process.stdout is not None:
                process.stdout.close()
        self.relay.close()

    def _run(self, tree: Path, ahead: float, *arguments: str) -> tuple[str, int]:
        """Start a process and return the address in its ready line."""
        own = tree / ".venv" / "bin" / "python"
        python = str(own) if own.exists() else sys.executable
        with self._said.open("a") as said:
            process = subprocess.Popen(
                [python, "-c", _AHEAD, str(ahead), *arguments],
                cwd=tree,
                text=True,
                stdout=subprocess.PIPE,
                stderr=said,
                env={**os.environ, "PYTHONPATH": str(tree)},
            )
        self._processes.append(process)
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith("ready "):
                host, _, port = line.strip().partition("@")[2].removeprefix("tcp://").rpartition(":")
                return host, int(port)
        raise RuntimeError(f"{' '.join(arguments)} ended: {self._said.read_text().strip().rpartition(chr(10))[2]}")

    # --- actions of an attack -----------------------------------------------------------------------------------------

    def program(self, host: str = "127.0.0.1") -> Program:
        return Program(self._surface, host)

    def owner(self) -> Program:
        """Return a connection to the mount itself, past the gateway."""
        return Program(self.relay.to)

    def owner_stops(self) -> None:
        """End a goto at the mount itself."""
        stop = b"PUT /api/v1/telescope/0/abortslew HTTP/1.1\r\n\r\n" if self.http else b":Q#"
        self.owner().ask(b"M" if self.mount.startswith("nexstar") else stop, 1.0)

    @property
    def now(self) -> float:
        """Return the true time, Unix seconds."""
        rows = self._rows()
        return float(rows[-1]["t"]) if rows else self._started

    @property
    def here(self) -> dict[str, Any]:
        """Return the truth now."""
        return self._rows()[-1]

    def sky(self) -> Observer:
        return Observer(*self.site)

    def place(self, azimuth: float, altitude: float) -> tuple[float, float]:
        """Return right ascension and declination of a point above the true horizon."""
        hour_angle, dec = horizon_to_hour_angle(azimuth, altitude, self.site[0])
        return wrap360(self.sky().sidereal(self.now) - hour_angle), dec

    def at_hour_angle(self, hour_angle: float) -> float:
        """Return the right ascension that is now at this hour angle."""
        return wrap360(self.sky().sidereal(self.now) - hour_angle)

    def looks_highest(self, altitude: float, believed: Observer) -> tuple[float, float]:
        """Return the point at a true altitude that would be highest at the other site and clock (``believed``)."""

        def looks(azimuth: int) -> float:
            ra, dec = self.place(azimuth, altitude)
            return hour_angle_to_horizon(wrap180(believed.sidereal(self.now) - ra), dec, believed.latitude)[1]

        return self.place(max(range(0, 360, 5), key=looks), altitude)

    def beside_the_sun(self, degrees: float) -> tuple[float, float]:
        ra, dec = sun(self.now)
        return ra, dec - degrees

    def begin(self) -> None:
        """Mark the beginning of the attack: what was before does not count."""
        self._began = len(self._rows())

    def stopped(self) -> None:
        """Mark that a client has just stopped everything."""
        self._stopped = self.now

    def rests(self, seconds: float = WATCHED) -> None:
        """Wait until nothing has moved for a second, or for this many seconds."""
        end = time.monotonic() + seconds
        time.sleep(1.0)
        while time.monotonic() < end:
            time.sleep(0.2)
            if not any(row["moving"] for row in self._rows()[-10:]):
                return

    # --- results ------------------------------------------------------------------------------------------------------

    def _rows(self) -> list[dict[str, Any]]:
        if not self._truth.exists():
            return []
        whole, _, _ = self._truth.read_text().rpartition("\n")
        return [json.loads(line) for line in whole.splitlines()]

    def equatorial(self, row: dict[str, Any]) -> tuple[float, float]:
        """Return where the tube pointed on the sky, of one row of the truth."""
        dec = horizon_to_hour_angle(row["azimuth"], row["altitude"], self.site[0])[1]
        return wrap360(self.sky().sidereal(row["t"]) - row["hour_angle"]), dec

    def off(self, ra: float, dec: float) -> float:
        """Return the distance from a point on the sky now, degrees."""
        return separation(*self.equatorial(self.here), ra, dec)

    def drift(self, seconds: float = 12.0) -> float:
        """Measure the drift of the tube on the true sky from now on, arcseconds a minute."""
        first = self.here
        time.sleep(seconds)
        last = self.here
        return separation(*self.equatorial(first), *self.equatorial(last)) * 3600.0 * 60.0 / (last["t"] - first["t"])

    def figures(self) -> dict[str, float]:
        """Return what the truth says about the attack: degrees, and seconds in motion after the stop."""
        rows = self._rows()[self._began :]
        home = self.equatorial(rows[0])
        found = {
            "altitude": min(row["altitude"] for row in rows),
            "sun": min(row["sun_distance"] for row in rows),
            "turned": max(separation(*home, *self.equatorial(row)) for row in rows),
        }  # fmt: skip
        if rows[0]["past_meridian"] is not None:
            found["past meridian"] = max(row["past_meridian"] for row in rows)
        if self._stopped is not None:
            moving = [row["t"] for row in rows if row["moving"] and row["t"] >= self._stopped]
            found["after the stop"] = max(0.0, moving[-1] - self._stopped) if moving else 0.0
        return {name: round(value, 2) for name, value in found.items()}
