"""``tables`` and ``explain``: the outcome of every command per model, and of one command in words and bytes."""

from __future__ import annotations

import argparse

from gateway.cli.command_line import Commands


def add_tables(commands: Commands) -> None:
    tables = commands.add_parser(
        "tables",
        description="Prints as Markdown what becomes of every command of every protocol (mappings/README.md holds "
                    "the same), or of those that programs can send to one mount.",
        epilog="Examples:\n  mount-gateway tables --model 6se | less\n  mount-gateway tables --model lx200gps\n"
               "  mount-gateway tables --model nexstar:cge/3.02",
    )  # fmt: skip
    group = tables.add_mutually_exclusive_group()
    group.add_argument(
        "--write",
        action="store_true",
        help="play what is new, and write what becomes of it: mappings/README.md, mappings/*/played.toml",
    )
    group.add_argument(
        "--check", action="store_true", help="fail when what --write has written is stale, or a row is wrong"
    )
    group.add_argument("--model", metavar="MODEL[/VERSION]", help="only what becomes of them on one mount: cpc/4.21")
    tables.set_defaults(run=_tables)


def _model(words: str) -> str:
    """Return ``PROTOCOL:MODEL[/VERSION]`` for a model as users write it. Raises UserError."""
    from gateway.app.config import parse_device

    known = parse_device(words)
    version = f"/{known.version}" if known.version else ""
    return f"{known.protocol}:{known.model}{version}" if known.model else words


def _tables(arguments: argparse.Namespace) -> int:
    from gateway.diagnostics import command_tables

    if arguments.check:
        return command_tables.check()
    if arguments.write:
        print(command_tables.write())
        return 0
    print(command_tables.one(_model(arguments.model)) if arguments.model else command_tables.text())
    return 0


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
    explain.add_argument("client", help="what the program believes to speak to: lx200, nexstar, lx200:lx200gps, cpc")
    explain.add_argument("mount", help="the mount: nexstar, lx200, nexstar:cge/3.01, or a model's word: 6se, cpc")
    explain.add_argument("command", help="for example ':Sr05:34:32#'; \\x06 and the like are understood")
    explain.set_defaults(run=_explain)


def _explain(arguments: argparse.Namespace) -> int:
    from gateway.diagnostics.rehearsal.explain import explain

    told = explain(arguments.client, arguments.mount, arguments.command)
    print(told.text)
    return 0 if told.valid else 1
