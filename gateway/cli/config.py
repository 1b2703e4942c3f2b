"""``config``: the configuration in effect, or an example with every key there is."""

from __future__ import annotations

import argparse

from gateway.cli.command_line import Commands
from gateway.cli.serve.settings import add_settings, settings


def add_config(commands: Commands) -> None:
    config = commands.add_parser(
        "config", help="the configuration in effect, or an example of gateway.toml",
        description="Prints what run would go by, and where each value comes from.",
        epilog="Examples:\n  mount-gateway config --example > gateway.toml\n"
               "  mount-gateway config --config gateway.toml",
    )  # fmt: skip
    group = config.add_mutually_exclusive_group()
    group.add_argument("--example", action="store_true", help="a complete gateway.toml with every key explained")
    group.add_argument("--table", action="store_true", help="every key as a Markdown table")
    add_settings(config)
    config.set_defaults(run=_config)


def _config(arguments: argparse.Namespace) -> int:
    from gateway.app.config import showing

    if arguments.example:
        text = showing.example()
    elif arguments.table:
        text = showing.table()
    else:
        text = showing.effective(*settings(arguments))
    print(text, end="")
    return 0
