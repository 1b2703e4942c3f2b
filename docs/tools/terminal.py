"""Makes the picture of a terminal in the README: a real run on a simulated mount, with a program that moves it.

    python docs/tools/terminal.py

It writes docs/pictures/terminal.svg. The gateway writes to a terminal of its own, whose colours are kept. What it asks
the mount before it is ready is left out; the port number is replaced by the usual one.
"""

from __future__ import annotations

import fcntl
import os
import pty
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
from html import escape
from pathlib import Path

PICTURE = Path(__file__).resolve().parent.parent / "pictures" / "terminal.svg"
COLUMNS, WIDE, HIGH, EDGE = 100, 8.4, 19, 18
WORDS = ["run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:0", "--log=changes"]
QUIET = ["--no-status", "--no-console"]
#: Messier 81, which does not set at the simulated mount's site, and is never near the Sun.
SENT = (b":GR#", b":Sr09:57:58#", b":Sd+68*56:10#", b":MS#")
COLOURS = {"31": "#ff7b72", "32": "#7ee787", "33": "#e3b341", "36": "#79c0ff", "2": "#8b949e"}
PAPER, INK = "#0d1117", "#e6edf3"


def main() -> None:
    command = " ".join(["mount-gateway", *WORDS]).replace(":0", ":4030")
    told = session()
    lines = [f"$ {command}", *told[told.index("found ") :].splitlines()]
    PICTURE.write_text(drawn(lines), "utf-8")
    print(PICTURE.name, PICTURE.stat().st_size)


def session() -> str:
    """Return what the gateway writes from its start to its end by Ctrl-C."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, COLUMNS, 0, 0))
    with tempfile.TemporaryDirectory() as state:
        environment = {**os.environ, "TERM": "xterm-256color", "STATE_DIRECTORY": state}
        environment.pop("NO_COLOR", None)
        gateway = subprocess.Popen(
            [sys.executable, "-m", "gateway", *WORDS, *QUIET],
            stdin=theirs, stdout=theirs, stderr=theirs, env=environment, start_new_session=True,
        )  # fmt: skip
        os.close(theirs)
        told: list[bytes] = []
        reader = threading.Thread(target=read, args=(ours, told))
        reader.start()
        port = int(wait_for(rb"ready \S+127\.0\.0\.1:(\d+)", told)[1])
        wait_for(rb"site .*clock", told)
        with socket.create_connection(("127.0.0.1", port), 10) as program:
            for command in SENT:
                program.sendall(command)
                time.sleep(0.4)
            time.sleep(2.0)
        gateway.send_signal(signal.SIGINT)
        gateway.wait(20)
        reader.join(10)
    return b"".join(told).decode().replace(f":{port}", ":4030").replace(":0, host", ":4030, host")


def read(terminal: int, told: list[bytes]) -> None:
    """Read until the last process that writes to it has ended, which Linux reports as an error."""
    try:
        while data := os.read(terminal, 65536):
            told.append(data)
    except OSError:
        pass
    os.close(terminal)


def wait_for(pattern: bytes, told: list[bytes]) -> re.Match[bytes]:
    until = time.monotonic() + 30
    while time.monotonic() < until:
        if (found := re.search(pattern, b"".join(told))) is not None:
            return found
        time.sleep(0.05)
    raise SystemExit(f"the gateway does not say {pattern!r}: {b''.join(told)!r}")


def drawn(lines: list[str]) -> str:
    """Return lines with the colours of a terminal as SVG."""
    texts = []
    for number, line in enumerate(lines):
        colour, across = INK, 0
        for code, text in re.findall(r"(?:\x1b\[([\d;]*)m)|([^\x1b\r]+)", line):
            if text:
                place = f'x="{EDGE + across * WIDE:g}" y="{EDGE + (number + 0.75) * HIGH:g}"'
                size = f'textLength="{len(text) * WIDE:g}" fill="{colour}"'
                texts.append(f'<text {place} {size} xml:space="preserve">{escape(text)}</text>')
                across += len(text)
            else:
                colour = COLOURS.get(code, INK)
    width, height = 2 * EDGE + COLUMNS * WIDE, 2 * EDGE + len(lines) * HIGH
    font = "ui-monospace, 'SF Mono', 'Cascadia Mono', 'DejaVu Sans Mono', monospace"
    box = f'viewBox="0 0 {width:g} {height:g}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {box} font-family="{font}" font-size="14">\n'
        f'<rect width="{width:g}" height="{height:g}" rx="8" fill="{PAPER}"/>\n' + "\n".join(texts) + "\n</svg>\n"
    )


if __name__ == "__main__":
    main()
