"""``explain``: what happens to one command, in words and bytes."""

from __future__ import annotations

import argparse
from typing import Any


def add(commands: Any) -> None:
    """Put the command into the parser."""
    explain = commands.add_parser("explain", help="what happens to one command, in words and bytes",
                                  epilog="Examples:\n  mount-gateway explain lx200 nexstar :MS#\n"
                                  "  mount-gateway explain lx200:lx200gps nexstar:cge/3.02 :gT#")
    explain.add_argument("client", help="the protocol the command is written in: lx200, nexstar or lx200:lx200gps")
    explain.add_argument("mount", help="the protocol of the mount: nexstar, lx200 or nexstar:cge/3.01")
    explain.add_argument("command", help="for example ':Sr05:34:32#'; \\x06 and the like are understood")
    explain.set_defaults(run=_explain)


def _explain(arguments: argparse.Namespace) -> int:
    from gateway.rehearsal.explain import explain

    print(explain(arguments.client, arguments.mount, arguments.command))
    return 0
