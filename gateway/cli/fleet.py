"""``fleet``: a page with all mounts on an MQTT broker, and STOP for each of them and for all."""

from __future__ import annotations

import argparse
import asyncio
import re
import time
from typing import TYPE_CHECKING

from gateway.cli.command_line import Commands
from gateway.core.errors import UserError
from gateway.system import streams

if TYPE_CHECKING:
    from gateway.fleet.client import BrokerAccess

PORT = 4090
#: The keys of ``[mqtt]`` in gateway.toml that are flags of this command.
MQTT_KEYS = ("prefix", "password-file", "ca")
EXAMPLES = """\
Examples:
  mount-gateway fleet --mqtt mqtt://broker.local
      all mounts that gateways show there (mount-gateway run --mqtt URL), on a page at port 4090
  mount-gateway fleet --mqtt mqtts://observatory@broker.example.org --password-file password.txt
      the same on a broker with users and passwords

The page is for browsers of this computer. From elsewhere: ssh -L 4090:127.0.0.1:4090 COMPUTER
"""


def add_fleet(commands: Commands) -> None:
    from gateway.app.config.describing import keys_of

    fleet = commands.add_parser(
        "fleet",
        description="Shows every mount of an MQTT broker on a page in the browser, with a STOP for each and one for "
        "all. It moves nothing. Ctrl-C ends it.",
        epilog=EXAMPLES,
    )  # fmt: skip
    fleet.add_argument("--mqtt", metavar="URL", required=True, help="mqtt://[USER@]HOST:PORT, or mqtts:// with TLS")
    for key in keys_of("mqtt"):
        if key.name in MQTT_KEYS:
            fleet.add_argument(f"--{key.name}", default=key.default, metavar=key.metavar, help=key.help)
    fleet.add_argument("--port", type=int, default=PORT, help=f"of the page, on this computer (default {PORT})")
    fleet.set_defaults(run=_run_fleet)


def _run_fleet(arguments: argparse.Namespace) -> int:
    from gateway.app.config.tables import TOPIC_PREFIX_PATTERN
    from gateway.fleet.client import get_access

    if not 0 <= arguments.port <= 65535:
        raise UserError(f"--port {arguments.port}: write a number from 1 to 65535")
    if re.match(TOPIC_PREFIX_PATTERN, arguments.prefix) is None:
        raise UserError(f"--prefix {arguments.prefix!r}: write words of letters, digits and _ . -, with / between")
    broker_access = get_access(arguments.mqtt, None, arguments.password_file, arguments.ca)
    return asyncio.run(_serve(broker_access, arguments.prefix, arguments.port))


async def _serve(access: BrokerAccess, prefix: str, port: int) -> int:
    from gateway.cli.serve.signals import end_signal_event
    from gateway.console.server import PAGE_FOLDER
    from gateway.fleet.overview.server import OverviewServer

    done, was_connected = end_signal_event(), True

    def on_connection(connected: bool, reason: str) -> None:
        nonlocal was_connected
        if connected != was_connected:
            state = "is connected again" if connected else f"cannot be reached: {reason}; this page keeps trying"
            streams.warn(f"the broker {access.broker} {state}", streams.WARNING)
        was_connected = connected

    page = OverviewServer(access, prefix, PAGE_FOLDER, time.time, on_connection)
    await page.open(port)
    streams.print_line(f"ready fleet {page.address}")
    try:
        await done.wait()
    finally:
        await page.close()
    return 0
