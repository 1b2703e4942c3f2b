"""Every command there is, and the parser of the command line.

In every module ``add`` puts its command into the parser, and the rest of the file carries it out. Only the one that is
asked for is loaded: a gateway should be there soon after power-on.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from importlib import import_module

from gateway.cli.help import EXIT_CODES, Parser, endpoints
from gateway.core.about import VERSION

#: Every command, in the order in which ``--help`` lists them, and the module that it lies in.
COMMANDS = {
    "demo": "serve.demo",
    "detect": "inspect.detect",
    "doctor": "inspect.doctor",
    "run": "serve.run",
    "status": "mount.status",
    "watch": "mount.watch",
    "goto": "mount.goto",
    "sync": "mount.sync",
    "move": "mount.move",
    "park": "mount.park",
    "unpark": "mount.unpark",
    "stop": "mount.stop",
    "fleet": "fleet",
    "config": "config",
    "service": "serve.service",
    "sim": "serve.sim",
    "tables": "inspect.tables",
    "explain": "inspect.explain",
    "replay": "inspect.replay",
    "decode": "inspect.decode",
    "report": "inspect.report",
    "completion": "completion",
}

FIRST = """\
Lets Meade LX200 software drive a Celestron NexStar mount, and the reverse.

First steps:
  mount-gateway demo      without a mount: simulates one, and prints where your program can connect
  mount-gateway detect    with a mount: finds its port, and prints the command that starts the gateway
  mount-gateway run --mount nexstar@/dev/ttyUSB0 --surface lx200@tcp://127.0.0.1:4030
                          starts it: your program connects to port 4030 as if to a Meade
  mount-gateway goto Polaris
                          while it runs, from another terminal: moves the mount without any program

mount-gateway COMMAND --help tells more, with examples.
"""


def parser(asked: Sequence[str] = ()) -> Parser:
    """The whole command line, or only the command that is asked for."""
    whole = Parser(prog="mount-gateway", description=FIRST, late=lambda: f"{endpoints()}\n\n{EXIT_CODES}")
    whole.add_argument("--version", action="version", version=f"mount-gateway {VERSION}")
    commands = whole.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for name in [name for name in COMMANDS if name in asked] or COMMANDS:
        import_module(f"gateway.cli.{COMMANDS[name]}").add(commands)
    return whole


def commands_of(whole: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """The parsers of all commands by name."""
    [choices] = [action.choices for action in whole._actions if isinstance(action, argparse._SubParsersAction)]
    return dict(choices)
