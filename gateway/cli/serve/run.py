"""``run`` and ``config``: run a gateway by flags and ``gateway.toml``, or print the configuration in effect."""

from __future__ import annotations

import argparse

from gateway.cli.command_line import EXIT_CODES, Commands, endpoints
from gateway.cli.serve.serving import make_watchdog, serve_mounts, with_loop
from gateway.cli.serve.settings import add_settings, settings

EXAMPLES = """\
Examples:
  mount-gateway run --mount nexstar@/dev/ttyUSB0 --surface lx200@tcp://127.0.0.1:4030
      LX200 programs on this computer drive the Celestron that is plugged in
  mount-gateway run --mount lx200@/dev/ttyUSB0 --surface nexstar@tcp://0.0.0.0:4030 --log
      NexStar programs, on other computers too, drive a Meade; every word of it is shown
  mount-gateway run --mount nexstar@/dev/ttyUSB0 --surface lx200@pty:/tmp/lx200 --lowest 15
      a program that wants a serial port gets /tmp/lx200; nothing is pointed lower than 15 degrees
  mount-gateway run --mount nexstar@/dev/ttyUSB0 --surface any@tcp://127.0.0.1:4040
      programs of every protocol, and a browser, on one port
  mount-gateway run --config gateway.toml
      all that from a file: mount-gateway config --example prints one
"""


def add_run(commands: Commands) -> None:
    run = commands.add_parser(
        "run",
        description="Connects programs to a mount. Prints a line that begins with \"ready\" for every place where they "
                    "can connect, and serves until Ctrl-C, which stops the mount first.",
        late=lambda: f"{EXAMPLES}\n{endpoints()}\n\n{EXIT_CODES}",
    )  # fmt: skip
    add_settings(run)
    run.add_argument("--loop", choices=("fast", "asyncio"), default="fast", help="event loop: uvloop where it exists")
    run.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    config, _ = settings(arguments)
    return with_loop(
        arguments.loop == "fast",
        lambda: serve_mounts(config, watchdog=make_watchdog(config)),
        any(mount.record for mount in config.mount),
    )


def add_config(commands: Commands) -> None:
    config = commands.add_parser(
        "config",
        description="Prints what run would go by, and where each value comes from. It takes every flag of run, too: "
                    "mount-gateway run --help lists them.",
        epilog="Examples:\n  mount-gateway config --example > gateway.toml\n"
               "  mount-gateway config gateway.toml\n  mount-gateway config gateway.toml --lowest 15",
    )  # fmt: skip
    group = config.add_mutually_exclusive_group()
    group.add_argument("--example", action="store_true", help="a complete gateway.toml with every key explained")
    group.add_argument("--table", action="store_true", help="every key as a Markdown table")
    own = len(config._actions)
    add_settings(config)
    config.elsewhere = config._actions[own:]
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
