"""``run`` and ``config``: run a gateway by flags and ``gateway.toml``, or print the configuration in effect."""

from __future__ import annotations

import argparse

from gateway.cli.command_line import Commands
from gateway.cli.serve.serving import make_watchdog, run_on_loop, serve_mounts
from gateway.cli.serve.settings import add_setting_flags, load_config

HELP_EPILOG = """\
A mount is nexstar@/dev/ttyUSB0, lx200@COM3, alpaca@http://HOST:PORT, or nexstar@sim (simulated). A surface, where \
programs connect, is lx200@tcp://127.0.0.1:4030, nexstar@pty:/tmp/nexstar (a virtual serial port), \
alpaca@tcp://127.0.0.1:11111, stellarium@tcp://127.0.0.1:10001, or any@tcp://127.0.0.1:4040 for all of these and \
browsers. With 0.0.0.0 other computers can connect, too.

Examples:
  mount-gateway run --mount nexstar@/dev/ttyUSB0 --surface lx200@tcp://127.0.0.1:4030
      LX200 programs on this computer drive a Celestron
  mount-gateway run --mount lx200@/dev/ttyUSB0 --surface nexstar@tcp://0.0.0.0:4030
      NexStar programs, on other computers too, drive a Meade
  mount-gateway run --config gateway.toml
      everything from a file: mount-gateway config --example prints one

mount-gateway run --help all lists every option, and mount-gateway --help all the models.
"""


def add_run(commands: Commands) -> None:
    run = commands.add_parser(
        "run",
        usage="mount-gateway run --mount PROTOCOL@WHERE --surface PROTOCOL@WHERE\n"
              "       mount-gateway run gateway.toml",
        description="Connects programs to a mount. Prints a line that begins with \"ready\" for every place where they "
                    "can connect. Ctrl-C stops the mount and ends the gateway.",
        make_epilog=lambda: HELP_EPILOG,
        more_help=str,
    )  # fmt: skip
    loop = run.add_argument(
        "--loop", choices=("fast", "asyncio"), default="fast", help="event loop: uvloop where it exists"
    )
    run.hidden_actions = [loop, *add_setting_flags(run)]
    run.set_defaults(run=_run_gateway)


def _run_gateway(arguments: argparse.Namespace) -> int:
    config, _ = load_config(arguments)
    return run_on_loop(arguments.loop == "fast", lambda: serve_mounts(config, watchdog=make_watchdog(config)))


def add_config(commands: Commands) -> None:
    config = commands.add_parser(
        "config",
        description="Prints the configuration that run would use, and where each value comes from. It takes every "
        "flag of run, too: "
                    "mount-gateway run --help lists them.",
        epilog="Examples:\n  mount-gateway config --example > gateway.toml\n"
               "  mount-gateway config gateway.toml\n  mount-gateway config gateway.toml --lowest 15",
    )  # fmt: skip
    config.add_argument("--example", action="store_true", help="a complete gateway.toml with every key explained")
    before = len(config._actions)
    add_setting_flags(config)
    config.suppressed_actions = config._actions[before:]
    config.set_defaults(run=_run_config)


def _run_config(arguments: argparse.Namespace) -> int:
    from gateway.app.config import showing

    text = showing.example_toml() if arguments.example else showing.effective_toml(*load_config(arguments))
    print(text, end="")
    return 0
