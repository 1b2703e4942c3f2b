"""The programs that are measured, as child processes of the benchmark.

Each is started with the interpreter that runs the benchmark, listens on a free port of the loopback interface, and is
ended by its own process id. Compiled bytecode goes to a temporary directory, so that an installation and a checkout
start alike and the checkout stays clean; a gateway's state and the almanac go there too.
"""

from __future__ import annotations

import json
import os
import select
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
HOST = "127.0.0.1"
PATIENCE = 20.0


def environment(bytecode: str) -> dict[str, str]:
    """Return this process's environment, with bytecode and a gateway's state in the directory ``bytecode``."""
    kept = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, "PYTHONPYCACHEPREFIX": bytecode, "STATE_DIRECTORY": bytecode, "CACHE_DIRECTORY": bytecode}


def exact(bytecode: str) -> bool:
    """Whether the gateway that runs has calculated its readings from the almanac, as ``status --json`` says."""
    command = [sys.executable, "-m", "gateway", "status", "--json", "--state", bytecode]
    told = subprocess.run(command, cwd=ROOT, env=environment(bytecode), check=True, capture_output=True, text=True)
    [mount] = json.loads(told.stdout)
    return str(mount["sky"]).startswith("almanac of ")


@contextmanager
def child(command: list[str], bytecode: str, log: str = "stdout") -> Iterator[subprocess.Popen[bytes]]:
    """Run a program; ``log`` is the stream that is read here, the other one is discarded."""
    process = subprocess.Popen(
        command,
        cwd=ROOT,
        env=environment(bytecode),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE if log == "stdout" else subprocess.DEVNULL,
        stderr=subprocess.PIPE if log == "stderr" else subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        end(process)


def end(process: subprocess.Popen[bytes]) -> None:
    """Ask a process to end, and kill it if it does not."""
    process.terminate()
    try:
        process.wait(5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    for stream in (process.stdout, process.stderr):
        if stream is not None:
            stream.close()


def port_of(process: subprocess.Popen[bytes], log: str = "stdout") -> int:
    """Return the port in the first line of a program that ends with one. Raises RuntimeError if none comes in time."""
    stream, deadline, written = getattr(process, log), time.monotonic() + PATIENCE, b""
    while (left := deadline - time.monotonic()) > 0.0 and select.select([stream], [], [], left)[0]:
        more = os.read(stream.fileno(), 4096)
        written += more
        for line in written.splitlines()[: written.count(b"\n")]:
            number = line.decode().rpartition(":")[2]
            if number.isdigit():
                return int(number)
        if not more:
            break
    raise RuntimeError(f"{process.args!r} did not come up")


class Direction(NamedTuple):
    """A kind of program on a kind of mount: its position requests in turn, and the one for the slew."""

    name: str
    simulator: str
    mount: str
    surface: str
    position: tuple[bytes, ...]
    slewing: bytes
    #: The requests to the mount within a heartbeat at most: a position, the site of a mount that keeps its own, the
    #: status.
    heartbeat: int


LX200_ON_NEXSTAR = Direction("LX200 on NexStar", "nexstar:6-8se", "nexstar", "lx200", (b":GR#", b":GD#"), b":D#", 4)
NEXSTAR_ON_LX200 = Direction("NexStar on LX200", "lx200:lx200gps", "lx200", "nexstar", (b"e",), b"L", 3)
DIRECTIONS = (LX200_ON_NEXSTAR, NEXSTAR_ON_LX200)


@contextmanager
def simulator(bytecode: str, latency: float = 0.0, way: Direction = LX200_ON_NEXSTAR) -> Iterator[int]:
    """Run a simulated mount and yield its TCP port. ``latency`` is its time to reply in seconds."""
    command = [sys.executable, "-m", "gateway", "sim", way.simulator, "--at", f"tcp://{HOST}:0"]
    with child([*command, "--latency", str(latency)], bytecode) as process:
        yield port_of(process)


def gateway_command(mount: int, surface: int = 0, loop: str = "fast", way: Direction = LX200_ON_NEXSTAR) -> list[str]:
    """Return the command line of a gateway between two TCP ports."""
    return [
        sys.executable,
        "-m",
        "gateway",
        "run",
        "--loop",
        loop,
        "--mount",
        f"{way.mount}@socket://{HOST}:{mount}",
        "--surface",
        f"{way.surface}@tcp://{HOST}:{surface}",
    ]


@contextmanager
def gateway(bytecode: str, mount: int, loop: str = "fast", way: Direction = LX200_ON_NEXSTAR) -> Iterator[int]:
    """Run a gateway in front of a mount's TCP port and yield its own TCP port."""
    with child(gateway_command(mount, loop=loop, way=way), bytecode) as process:
        yield port_of(process)


@contextmanager
def echo(bytecode: str, loop: str) -> Iterator[int]:
    """Run the bare echo server and yield its TCP port."""
    with child([sys.executable, str(HERE / "echo.py"), loop], bytecode) as process:
        yield port_of(process)


@contextmanager
def forwarder(bytecode: str, target: int) -> Iterator[int]:
    """Run socat, which forwards one connection's bytes to a TCP port, and yield its own TCP port."""
    listen = f"TCP4-LISTEN:0,bind={HOST},nodelay"
    with child(["socat", "-d", "-d", listen, f"TCP4:{HOST}:{target},nodelay"], bytecode, "stderr") as process:
        yield port_of(process, "stderr")


@contextmanager
def pinned(cores: set[int]) -> Iterator[None]:
    """Keep this process, and the children it starts within the block, on some cores."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, cores)
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def used(pid: int) -> float:
    """Return the seconds of processor time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def free_port() -> int:
    """Return a TCP port that is not in use."""
    with socket.create_server((HOST, 0)) as server:
        return int(server.getsockname()[1])


def connect(port: int) -> socket.socket:
    """Open a blocking connection that sends without delay."""
    connection = socket.create_connection((HOST, port), PATIENCE)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return connection


def connect_early(port: int) -> socket.socket:
    """Like `connect`, but retry every millisecond while the program is starting. Raises TimeoutError."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        try:
            return connect(port)
        except ConnectionRefusedError:
            time.sleep(0.001)
    raise TimeoutError(f"no program listens on port {port}")


def ask(connection: socket.socket, question: bytes) -> bytes:
    """Send a request and read its reply up to the ``#``. Raises OSError, also if there is no reply."""
    connection.sendall(question)
    reply = b""
    while not reply.endswith(b"#"):
        data = connection.recv(64)
        if not data:
            raise ConnectionError(f"closed after {question!r}")
        reply += data
    return reply
