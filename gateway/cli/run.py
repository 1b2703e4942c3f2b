"""``run``: connect clients to mounts, as the command line and ``gateway.toml`` say."""

from __future__ import annotations

import argparse
from typing import Any

from gateway.cli.serving import serve_mounts, with_loop
from gateway.cli.settings import add_settings, settings


def add(commands: Any) -> None:
    """Put the command into the parser."""
    run = commands.add_parser("run", help="connect clients to a mount, or to several")
    add_settings(run)
    run.add_argument("--loop", choices=("fast", "asyncio"), default="fast", help="event loop: uvloop where it exists")
    run.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    config, _ = settings(arguments)
    return with_loop(arguments.loop == "fast", lambda: serve_mounts(config))
