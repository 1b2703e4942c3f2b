"""Replays a recording made under load: every one of its replies must be the same, whole and file by file.

A gateway in a process of its own drives a simulated mount and is recorded in small files, while dozens of programs
poll, move and stop it, and others connect for one command. Then the recording is replayed.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from random import Random

#: What the programs send, with its weight; some of it has a reply.
LX200 = (
    (b":GR#", 30),
    (b":GD#", 30),
    (b":GA#", 8),
    (b":D#", 8),
    (b":GVP#:GR#", 4),
    (b":Sr05:34:32#:Sd+22*00:52#", 4),
    (b":MS#", 3),
    (b":Mn#", 4),
    (b":Qn#", 4),
    (b":Q#", 3),
    (b":GL#", 2),
)
NEXSTAR = (
    (b"e", 40),
    (b"z", 15),
    (b"L", 10),
    (b"J", 8),
    (b"t", 6),
    (b"h", 4),
    (b"w", 2),
    (b"r34AB0500,12CE0500", 3),
    (b"P\x02\x10\x24\x05\x00\x00\x00", 5),
    (b"P\x02\x10\x24\x00\x00\x00\x00", 5),
    (b"M", 2),
)
SERVE = """
import asyncio, sys
from gateway.cli import main
from gateway.app.recording.recorded_gateway import record_whole
record_whole.__defaults__ = (int(sys.argv.pop(1)),)
sys.exit(main())
"""


async def program(port: int, words: tuple[tuple[bytes, int], ...], random: Random, until: float, pause: float) -> int:
    """Run one program with ``pause`` seconds between two commands on average; return the bytes it received."""
    told = 0
    with contextlib.suppress(OSError):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        while time.monotonic() < until:
            writer.write(random.choices([word for word, _ in words], [often for _, often in words])[0])
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(random.uniform(0.0, 2.0 * pause)):
                    data = await reader.read(4096)
                    told += len(data)
                    if not data:
                        break
                    await asyncio.sleep(2.0)
        writer.close()
    return told


async def crowd(ports: list[int], many: int, seconds: float, new: float, seed: int) -> None:
    """Run ``many`` programs that stay connected, and start ``new`` short-lived ones a second."""
    random, until = Random(seed), time.monotonic() + seconds
    words = (LX200, NEXSTAR)
    work = [
        asyncio.create_task(program(ports[n % 2], words[n % 2], Random(seed + n), until, 0.05)) for n in range(many)
    ]
    while time.monotonic() < until:
        await asyncio.sleep(random.expovariate(new))
        n = random.randrange(2)
        work.append(
            asyncio.create_task(
                program(ports[n], words[n], Random(random.random()), time.monotonic() + random.uniform(0.0, 0.3), 0.05)
            )
        )
    await asyncio.gather(*work)


def record(path: Path, mount: str, arguments: argparse.Namespace, seed: int) -> None:
    """Run a gateway under load, and record it."""
    command = [
        sys.executable,
        "-c",
        SERVE,
        str(arguments.part),
        "run",
        "--no-console",
        "--mount",
        mount,
        "--latency",
        "0.01",
        "--surface",
        "lx200@tcp://127.0.0.1:0",
        "--surface",
        "nexstar@tcp://127.0.0.1:0",
        "--lowest",
        "-90",
        "--record",
        str(path),
        "--record-keep",
        "10000",
        "--state",
        str(path.parent / "state"),
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as gateway:
        assert gateway.stdout is not None
        ports = []
        while len(ports) < 2:
            line = gateway.stdout.readline()
            assert line, "the gateway has ended"
            if line.startswith("ready"):
                ports.append(int(line.split()[1].rpartition(":")[2]))
        asyncio.run(crowd(ports, arguments.clients, arguments.seconds, arguments.new, seed))
        gateway.terminate()


def played(path: Path) -> tuple[bool, str]:
    """Replay a recording; return whether it was the same, and what ``replay`` printed."""
    began = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-m", "gateway", "replay", str(path)], capture_output=True, text=True, timeout=600.0
    )
    said = (done.stdout + done.stderr).strip()
    return done.returncode == 0 and "Traceback" not in said, f"{said[-600:]} ({time.monotonic() - began:.1f} s)"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--clients", type=int, default=56)
    parser.add_argument("--new", type=float, default=20.0, help="connections a second that come and go")
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--part", type=int, default=1_000_000, help="bytes per file of a recording")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="leave the recordings in this directory")
    arguments = parser.parse_args()
    good = True
    for run in range(arguments.runs):
        mount = ("nexstar:cpc@sim", "lx200:lx200gps@sim", "lx200:autostar@sim")[run % 3]
        with tempfile.TemporaryDirectory() as temporary:
            folder = arguments.keep or Path(temporary)
            path = folder / f"night{run}.rec"
            record(path, mount, arguments, arguments.seed + run)
            parts = sorted(folder.glob(f"{path.name}.*"), key=lambda part: int(part.suffix[1:]), reverse=True)
            size = sum(part.stat().st_size for part in [path, *parts])
            print(f"run {run}: {mount}, {size / 1e6:.1f} MB in {len(parts) + 1} files")
            for part in {path, *parts[:1], *parts[len(parts) // 2 : len(parts) // 2 + 1]}:
                same, said = played(part)
                good &= same
                print(f"  {part.name}: {said}")
    print(f"most memory of a replay: {resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024:.0f} MB")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
