"""``explain``: what happens to one command, in words and bytes."""

from __future__ import annotations

import argparse

from gateway.cli.help import Commands


def add(commands: Commands) -> None:
    explain = commands.add_parser(
        "explain",
        help="what happens to one command, in words and bytes",
        epilog="Examples:\n  mount-gateway explain lx200 nexstar :MS#\n"
        "  mount-gateway explain lx200gps 6se :gT#\n"
        "  mount-gateway explain lx200:lx200gps nexstar:cge/3.02 :gT#\n\n"
        "The command is carried out by the whole gateway on a simulated mount that is "
        "aligned and tracks.",
    )
    explain.add_argument("client", help="what the program believes to speak to: lx200, nexstar, lx200:lx200gps, cpc")
    explain.add_argument("mount", help="the mount: nexstar, lx200, nexstar:cge/3.01, or a model's word: 6se, cpc")
    explain.add_argument("command", help="for example ':Sr05:34:32#'; \\x06 and the like are understood")
    explain.set_defaults(run=_explain)


def _explain(arguments: argparse.Namespace) -> int:
    from gateway.diagnostics.rehearsal.explain import explain

    print(explain(arguments.client, arguments.mount, arguments.command))
    return 0
