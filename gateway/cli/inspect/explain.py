"""``explain``: shows how the gateway translates one command, in sentences and bytes."""

from __future__ import annotations

import argparse

from gateway.cli.command_line import Commands


def add_explain(commands: Commands) -> None:
    explain = commands.add_parser(
        "explain",
        epilog="Examples:\n  mount-gateway explain lx200 nexstar :MS#\n"
        "  mount-gateway explain lx200gps 6se :gT#\n  mount-gateway explain nexstar lx200gps e\n"
        "  mount-gateway explain lx200:lx200gps nexstar:cge/3.02 :gT#\n\n"
        "The command is carried out by the whole gateway on a simulated mount that is\n"
        "aligned and tracks. The exit code is 1 if the command has a value that is\n"
        "not valid, or if the hand control that is presented does not have it.",
    )
    explain.add_argument("client", help="the mount that the program expects: lx200, nexstar, lx200:lx200gps, cpc")
    explain.add_argument("mount", help="the mount: nexstar, lx200, nexstar:cge/3.01, or a model: 6se, cpc")
    explain.add_argument("command", help="for example ':Sr05:34:32#'; \\x06 and the like are understood")
    explain.set_defaults(run=_run_explain)


def _run_explain(arguments: argparse.Namespace) -> int:
    from gateway.diagnostics.rehearsal.explain import explain

    explanation = explain(arguments.client, arguments.mount, arguments.command)
    print(explanation.text)
    return 0 if explanation.is_possible else 1
