"""``demo``: a simulated mount to play with."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from gateway.cli.serving import serve_mounts, with_loop
from gateway.cli.settings import add_flag
from gateway.config import Source, make_config
from gateway.config.describing import keys
from gateway.config.lines import Place

DEMO_PORT = 4030
#: The keys that the demo has as well.
SHOWN = ("log", "night")


def add(commands: Any) -> None:
    """Put the command into the parser."""
    demo = commands.add_parser(
        "demo", help="a simulated mount to play with, on TCP 4030 and a virtual serial port",
        description="Plays a mount and a gateway before it, so that a program can be tried out without either.",
        epilog="Talk to it by hand:\n  nc 127.0.0.1 4030\n  :GR#    where is it? it answers with the right ascension",
    )  # fmt: skip
    demo.add_argument("--port", type=int, default=DEMO_PORT, help="TCP port (default 4030; 0 takes any free one)")
    demo.add_argument("--pty", metavar="PATH", help="virtual serial port (default /tmp/lx200, reversed /tmp/nexstar)")
    demo.add_argument("--reverse", action="store_true", help="the other way: NexStar programs on a simulated Meade")
    demo.add_argument("--speed", type=float, default=4.0, help="slews this many times faster than real (default 4)")
    for key in keys(""):
        if key.name in SHOWN:
            add_flag(demo, key)
    demo.set_defaults(run=_demo)


def _demo(arguments: argparse.Namespace) -> int:
    client, mount, words = ("lx200", "nexstar", "NexStar 6/8 SE, driven by whatever LX200")
    if arguments.reverse:
        client, mount, words = ("nexstar", "lx200:lx200gps", "LX200GPS, driven by whatever NexStar")
    surfaces = [{"at": f"{client}@tcp://127.0.0.1:{arguments.port}"}]
    if sys.platform != "win32":
        path = f"/tmp/{client}" if arguments.pty is None else arguments.pty
        surfaces.append({"at": f"{client}@pty:{path}"})
    tables = {"mount": [{"at": f"{mount}@sim", "speed": arguments.speed}], "surface": surfaces,
              **{name: value for name in SHOWN if (value := getattr(arguments, name)) is not None}}
    flags: dict[Place, str] = {("mount", 0, "speed"): "--speed", ("surface", 0): "--port", ("surface", 1): "--pty",
                               ("log",): "--log"}
    config = make_config(tables, Source("demo", flags=flags))
    banner = f"A simulated {words} program connects. Ctrl-C ends it."
    return with_loop(True, lambda: serve_mounts(config, banner))
