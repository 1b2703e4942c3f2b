"""``demo``: runs a gateway with a simulated mount, so that programs can be tried without a telescope."""

from __future__ import annotations

import argparse
import contextlib
import os
import socket
import sys

from gateway.app.config import Source, make_config
from gateway.app.config.describing import keys_of
from gateway.app.config.source import Place
from gateway.cli.command_line import Commands
from gateway.cli.serve.serving import run_on_loop, serve_mounts
from gateway.cli.serve.settings import add_flag, add_table_flags, put_table_flags
from gateway.protocols.registry import ANY, ANY_PORT, PROTOCOLS, protocol_pairs
from gateway.system.own_commands import own_command
from gateway.transport.device_link import is_path_free

DEMO_PORT = 4030
#: This number added to the demo's port gives its second port, which serves programs of any protocol.
ANY_PORT_OFFSET = ANY_PORT - DEMO_PORT
#: How many ports, and names of virtual serial ports, are tried until one is free.
MAX_TRIES = 50
#: The keys of gateway.toml that are flags of the demo, too.
DEMO_KEYS = ("log", "night")
EXAMPLES = """\
Examples:
  mount-gateway demo                    a Celestron, for programs that drive a Meade
  mount-gateway demo --reverse          a Meade, for programs that drive a Celestron
  mount-gateway demo --speed 1 --log    as slow as a real one; shows every message

Talk to it by hand, from another terminal:
  nc 127.0.0.1 4030
  :GR#    where is it? it answers with the right ascension
and with --reverse, where a command is sent without the end of a line:
  printf e | nc -q1 127.0.0.1 4030            where is it?
  printf V | nc -q1 127.0.0.1 4030 | od -c    V, J, w and h answer in bytes
"""


def add_demo(commands: Commands) -> None:
    demo = commands.add_parser(
        "demo",
        description="Simulates a mount with a gateway, so that you can try a program without a mount.",
        epilog=EXAMPLES,
    )  # fmt: skip
    demo.add_argument(
        "--port",
        type=int,
        help=f"TCP port (default {DEMO_PORT}, or the next free one; 0 takes any); for any program +{ANY_PORT_OFFSET}",
    )
    demo.add_argument(
        "--pty",
        metavar="PATH",
        help="virtual serial port (default /tmp/lx200, reversed /tmp/nexstar, or the next free name)",
    )
    demo.add_argument("--reverse", action="store_true", help="the other way: NexStar programs on a simulated Meade")
    demo.add_argument("--speed", type=float, default=4.0, help="slews this many times faster than real (default 4)")
    for key in keys_of(""):
        if key.name in DEMO_KEYS:
            add_flag(demo, key)
    add_table_flags(demo, "console")
    demo.set_defaults(run=_run_demo)


def _run_demo(arguments: argparse.Namespace) -> int:
    client, driven = protocol_pairs()[1 if arguments.reverse else 0]
    mount, title = PROTOCOLS[driven].demo_mount or (driven, PROTOCOLS[driven].title)
    port, notes = arguments.port, []
    if port is None and (port := find_free_port(DEMO_PORT)) != DEMO_PORT:
        notes.append(f"another program uses port {DEMO_PORT}; this demo takes port {port}")
    anybody = 0 if arguments.port == 0 else find_free_port(port + ANY_PORT_OFFSET)
    surfaces = [{"at": f"{name}@tcp://127.0.0.1:{number}"} for name, number in ((ANY, anybody), (client, port))]
    if sys.platform != "win32":
        path = arguments.pty
        if path is None and (path := find_free_pty_path(f"/tmp/{client}")) != f"/tmp/{client}":
            notes.append(f"another program uses /tmp/{client}; this demo takes {path}")
        surfaces.append({"at": f"{client}@pty:{path}"})
    tables: dict[str, object] = {
        "mount": [{"at": f"{mount}@sim", "speed": arguments.speed, "sun": 0.0}],  # there is no glass to be harmed
        "surface": surfaces,
        **{name: value for name in DEMO_KEYS if (value := getattr(arguments, name)) is not None},
    }
    flags: dict[Place, str] = {
        ("mount", 0, "speed"): "--speed",
        ("surface", 0): "--port",
        ("surface", 1): "--port",
        ("surface", 2): "--pty",
        ("log",): "--log",
    }
    source = Source("demo", flags=flags)
    put_table_flags(arguments, "console", tables, source)
    config = make_config(tables, source)
    speed = "" if arguments.speed == 1 else f"\nIt slews {arguments.speed:g} times as fast as a real one."
    banner = "\n".join(
        [
            *notes,
            f"A simulated {title}, driven by any program that connects.{speed} Ctrl-C ends it.",
            f"Point any program{', and your browser,' if config.page is not None else ''} at the first address below.",
            f"To see it move, type in another terminal: {own_command()} goto Polaris",
        ]
    )
    return run_on_loop(True, lambda: serve_mounts(config, banner))


def find_free_port(first_port: int) -> int:
    """Return the first free port from ``first_port`` on; ``first_port`` itself if all that were tried are in use."""
    for port in range(first_port, min(first_port + MAX_TRIES, 65536)):
        with socket.socket() as tried:
            if os.name == "posix":
                tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            with contextlib.suppress(OSError):
                tried.bind(("127.0.0.1", port))
                tried.listen()
                return port
    return min(first_port, 65535)


def find_free_pty_path(path: str) -> str:
    """Return ``path``, or the first free path with a number appended; ``path`` itself if all of them are in use."""
    names = [path, *(f"{path}-{number}" for number in range(2, MAX_TRIES))]
    return next((name for name in names if is_path_free(name)), path)
