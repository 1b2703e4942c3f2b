"""The processes for the measurements of a fleet: a broker, gateways with several simulated mounts, and a subscriber.

Every process is a child, on a free port of the loopback interface, and is ended by its own id.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import paho.mqtt.client as mqtt
from paho.mqtt.enums import CallbackAPIVersion

from tests.benchmarks.processes import HOST, ROOT, end, environment, free_port

PATIENCE = 60.0
#: A target that every simulated mount at the default site may slew to, slowly.
GOTO = b":Sr02:00:00#:Sd+80*00:00#:MS#"


def until(what: str, holds: Callable[[], object], seconds: float = PATIENCE) -> None:
    """Wait until ``holds()`` is true. Raises RuntimeError after ``seconds``."""
    limit = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > limit:
            raise RuntimeError(f"{what}: not within {seconds:g} s")
        time.sleep(0.01)


class Broker:
    """mosquitto, which stores nothing on disk."""

    def __init__(self, folder: Path) -> None:
        self.port = free_port()
        self._config = folder / "mosquitto.conf"
        self._config.write_text(f"listener {self.port} {HOST}\nallow_anonymous true\nmax_queued_messages 100000\n")
        self.process = self.start()

    def start(self) -> subprocess.Popen[bytes]:
        """Start the broker, always on the same port."""
        self.process = subprocess.Popen(
            ["mosquitto", "-c", str(self._config)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        return self.process

    def end(self) -> None:
        end(self.process)

    @property
    def url(self) -> str:
        return f"mqtt://{HOST}:{self.port}"


class Gateway:
    """``mount-gateway run`` with ``mounts`` simulated mounts that slew slowly; ``ports`` are those of their surfaces.

    ``commands`` are (time, mount, bytes) of what was sent to the mounts, if ``log`` is on.
    """

    def __init__(self, folder: Path, name: str, mounts: int, url: str | None, log: bool = False, nice: int = 0) -> None:
        own = folder / name
        own.mkdir()
        lines = ["discovery = false\n"]
        for number in range(mounts):
            lines.append(
                f'[[mount]]\nname = "m{number}"\nat = "nexstar@sim"\nspeed = 0.05\nsun = 0.0\nlatency = 0.01\n'
            )
            lines.append(f'[[surface]]\nmount = "m{number}"\nat = "lx200@tcp://{HOST}:0"\n')
        if url is not None:
            lines.append(f'[mqtt]\nat = "{url}"\nid = "{name}"\n')
        (own / "gateway.toml").write_text("".join(lines))
        flags = ["--log=json-mount"] if log else []
        self.process = subprocess.Popen(
            [sys.executable, "-m", "gateway", "run", str(own / "gateway.toml"), "--no-console", "--no-status", *flags],
            cwd=ROOT, env=environment(str(own)), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True, preexec_fn=lambda: os.nice(nice) and None,
        )  # fmt: skip
        self.commands: list[tuple[float, str, bytes]] = []
        self.ports: list[int] = []
        self._readers = [threading.Thread(target=read, daemon=True) for read in (self._said, self._logged)]
        for reader in self._readers:
            reader.start()
        until("the gateway is ready", lambda: len(self.ports) == mounts)

    def _said(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if found := re.match(r"ready lx200.*:(\d+) m\d+$", line.strip()):
                self.ports.append(int(found[1]))

    def _logged(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            if '"to mount"' not in line or not line.startswith("{"):
                continue
            row = json.loads(line)
            if row["side"] == "mount":
                at = time.mktime(time.strptime(row["time"][:19], "%Y-%m-%dT%H:%M:%S")) - time.timezone
                self.commands.append((at + float(row["time"][19:23]), row["mount"], bytes.fromhex(row["hex"])))

    def seconds_used(self) -> float:
        """Return the processor seconds used so far."""
        return used(self.process.pid)

    def end(self) -> None:
        if self.process.poll() is None:
            self.process.terminate()
            self.process.wait(20.0)


def used(pid: int) -> float:
    """Return the processor seconds that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Onlooker:
    """A subscriber on the broker. ``heard`` are (Unix time, topic, payload)."""

    def __init__(self, broker: Broker, topic: str = "mount-gateway/#") -> None:
        self.heard: list[tuple[float, str, bytes]] = []
        self._client, self._port = mqtt.Client(CallbackAPIVersion.VERSION2), broker.port
        self._client.reconnect_delay_set(1, 1)
        self._client.on_message = self._hear
        self._client.on_connect = lambda client, *rest: client.subscribe(topic, 1)
        until("the broker listens", self._connected)
        self._client.loop_start()

    def _connected(self) -> bool:
        try:
            self._client.connect(HOST, self._port)
        except OSError:
            return False
        return True

    def _hear(self, client: Any, data: Any, message: Any) -> None:
        self.heard.append((time.time(), message.topic, message.payload))

    def say(self, topic: str, payload: bytes, retain: bool = False) -> Any:
        """Publish a message."""
        return self._client.publish(topic, payload, 1, retain)

    def newest(self, topic: str) -> bytes:
        """Return the last payload on this topic."""
        return next((payload for _, where, payload in reversed(self.heard) if where == topic), b"")

    def leave(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()
