"""Installs mount-gateway from a package index as users do, by pip, pipx and uv, and runs the demo that it installed.

    python3 release/tried.py INDEX VERSION

It needs Python with its venv module and nothing else, so it also runs in a bare root of a Linux distribution. It prints
one row for each way, and ends with 1 if one of them failed.
"""

from __future__ import annotations

import dataclasses
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import venv
from pathlib import Path

#: Seconds for an installation, and for the demo from its start to its end.
INSTALLED, READY = 600, 60


@dataclasses.dataclass(frozen=True)
class Tool:
    """A program from PyPI that installs programs: its words, and what tells it to keep to one folder."""

    words: tuple[str, ...]
    places: dict[str, str]


#: In the words, {index} is the address of the package index and {python} the Python that runs this.
TOOLS = {
    "pipx": Tool(
        ("install", "--quiet", "--pip-args=--extra-index-url {index}"),
        {"PIPX_HOME": "home", "PIPX_BIN_DIR": "bin", "PIPX_MAN_DIR": "man"},
    ),
    "uv": Tool(
        ("tool", "install", "--quiet", "--native-tls", "--index={index}", "--python={python}"),
        {"UV_TOOL_DIR": "home", "UV_TOOL_BIN_DIR": "bin", "UV_CACHE_DIR": "cache"},
    ),
}


def installed(way: str, index: str, wanted: str, folder: Path) -> Path:
    """Install a package by pip, or by a tool that pip installs; return it. Raises subprocess.SubprocessError."""
    pip = made(folder / "environment") / "pip"
    if way == "pip":
        run(pip, "install", "--quiet", "--extra-index-url", index, wanted)
        return pip.with_name("mount-gateway")
    run(pip, "install", "--quiet", way)
    words = (word.format(index=index, python=sys.executable) for word in TOOLS[way].words)
    places = {name: str(folder / place) for name, place in TOOLS[way].places.items()}
    run(pip.with_name(way), *words, wanted, **places)
    return folder / "bin" / "mount-gateway"


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
    late = threading.Timer(READY, demo.kill)  # a demo that never is ready, or never answers, is one that failed
    late.start()
    try:
        ready = next((line for line in demo.stdout if line.startswith("ready")), "")
        port = int(ready.split()[1].rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port), READY) as link:
            link.sendall(b":GR#")
            if re.fullmatch(rb"\d\d:\d\d:\d\d#", answer := link.recv(100)) is None:
                raise OSError(f"the demo answered {answer!r}")
    finally:
        demo.send_signal(signal.SIGINT)
        demo.wait()
        late.cancel()
    if demo.returncode:
        raise OSError(f"the demo ended with {demo.returncode}")
    return told


def main() -> int:
    index, version = sys.argv[1:]
    failed = 0
    for way in ("pip", *TOOLS):
        began = time.monotonic()
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            try:
                told = demo_runs(installed(way, index, f"mount-gateway=={version}", Path(folder)), Path(folder))
                outcome = f"{told}: the demo runs"
            except (OSError, ValueError, IndexError, subprocess.SubprocessError) as error:
                failed, reason = 1, getattr(error, "stderr", "") or str(error)
                outcome = f"FAILED: {reason.strip()[-600:]}"
        seconds = time.monotonic() - began
        print(f"Python {sys.version.split()[0]:8} {way:5} {seconds:4.0f} s  {outcome}", flush=True)
    return failed


if __name__ == "__main__":
    sys.exit(main())
