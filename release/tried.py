"""Installs mount-gateway from a package index as users do, by pip, pipx and uv, and runs the demo that it installed.

    python3 release/tried.py INDEX VERSION

It needs Python with its venv module and nothing else, so it also runs in a bare root of a Linux distribution. It prints
one row for each way, and ends with 1 if one of them failed.
"""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Callable
from pathlib import Path

#: Seconds for an installation, and for the demo to be ready and to end.
INSTALLED, READY = 600, 60


def by_pip(index: str, wanted: str, folder: Path) -> Path:
    environment = made(folder / "environment")
    run(environment / "pip", "install", "--quiet", "--extra-index-url", index, wanted)
    return environment / "mount-gateway"


def by_pipx(index: str, wanted: str, folder: Path) -> Path:
    tools = made(folder / "tools")
    run(tools / "pip", "install", "--quiet", "pipx")
    places = {
        "PIPX_HOME": str(folder / "pipx"),
        "PIPX_BIN_DIR": str(folder / "bin"),
        "PIPX_MAN_DIR": str(folder / "man"),
    }
    run(tools / "pipx", "install", "--quiet", f"--pip-args=--extra-index-url {index}", wanted, **places)
    return folder / "bin" / "mount-gateway"


def by_uv(index: str, wanted: str, folder: Path) -> Path:
    tools = made(folder / "tools")
    run(tools / "pip", "install", "--quiet", "uv")
    places = {
        "UV_TOOL_DIR": str(folder / "uv"),
        "UV_TOOL_BIN_DIR": str(folder / "bin"),
        "UV_CACHE_DIR": str(folder / "c"),
    }
    python = f"--python={sys.executable}"
    run(tools / "uv", "tool", "install", "--quiet", "--native-tls", "--index", index, python, wanted, **places)
    return folder / "bin" / "mount-gateway"


WAYS: dict[str, Callable[[str, str, Path], Path]] = {"pip": by_pip, "pipx": by_pipx, "uv": by_uv}


def made(folder: Path) -> Path:
    """Make an environment and return the folder of its programs."""
    venv.create(folder, with_pip=True)
    return folder / "bin"


def run(*words: object, **more: str) -> str:
    """Run a program and return what it prints. Raises subprocess.SubprocessError."""
    return subprocess.run(
        [*map(str, words)], env={**clean(), **more}, check=True, capture_output=True, text=True, timeout=INSTALLED
    ).stdout


def clean() -> dict[str, str]:
    """Return the environment without what leads Python to another installation."""
    return {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV"))}


def demo_runs(program: Path, folder: Path) -> str:
    """Run the demo, ask it for the position, end it; return the version that the program tells. Raises OSError."""
    told = run(program, "--version").strip()
    command = [str(program), "demo", "--port", "0", "--pty", str(folder / "lx200")]
    demo = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=folder, env=clean(), start_new_session=True)
    assert demo.stdout is not None
    timer = time.monotonic() + READY
    try:
        ready = next((line for line in demo.stdout if line.startswith("ready")), "")
        port = int(ready.split()[1].rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port), 10) as link:
            link.settimeout(max(1.0, timer - time.monotonic()))
            link.sendall(b":GR#")
            if re.fullmatch(rb"\d\d:\d\d:\d\d#", answer := link.recv(100)) is None:
                raise OSError(f"the demo answered {answer!r}")
    finally:
        demo.send_signal(signal.SIGINT)
        if demo.wait(READY):
            raise OSError(f"the demo ended with {demo.returncode}")
    return told


def main() -> int:
    index, version = sys.argv[1:]
    failed = 0
    for name, way in WAYS.items():
        began = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            try:
                told = demo_runs(way(index, f"mount-gateway=={version}", Path(folder)), Path(folder))
                outcome = f"{told}: the demo runs"
            except (OSError, ValueError, IndexError, subprocess.SubprocessError) as error:
                failed, reason = 1, getattr(error, "stderr", "") or str(error)
                outcome = f"FAILED: {reason.strip()[-600:]}"
        seconds = time.monotonic() - began
        print(f"Python {sys.version.split()[0]:8} {name:5} {seconds:4.0f} s  {outcome}", flush=True)
    return failed


if __name__ == "__main__":
    sys.exit(main())
