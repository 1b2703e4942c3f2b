"""``sim``: a simulated mount for other programs."""

from __future__ import annotations

import argparse
from math import inf
from typing import Any

from gateway import streams
from gateway.cli.serving import with_loop
from gateway.cli.signals import until_signal
from gateway.config import parse_device, parse_site
from gateway.config.endpoints import PROTOCOLS
from gateway.errors import UserError
from gateway.tables import load


def add(commands: Any) -> None:
    """Put the command into the parser."""
    sim = commands.add_parser("sim", help="a simulated mount for other programs", epilog=_epilog)
    sim.add_argument("device", metavar="PROTOCOL[:MODEL[/VERSION]]", help="for example nexstar:cpc/4.21")
    sim.add_argument("--at", action="append", metavar="WHERE", help="tcp://HOST:PORT or pty:PATH; may be repeated")
    sim.add_argument("--latency", type=float, default=0.0, metavar="S", help="seconds to answer (a real one: 0.1-0.3)")
    sim.add_argument("--baud", type=int, metavar="N", help="understand this rate only, on a pty as on a real port")
    sim.add_argument("--speed", type=float, default=1.0, help="slews this many times faster")
    sim.add_argument("--time", metavar="ISO", help="begin at this UTC time")
    sim.add_argument("--site", metavar="LAT,LON", default="45,10", help="default 45,10")
    sim.add_argument("--unaligned", action="store_true", help="as after power-on, before the star alignment")
    sim.set_defaults(run=_sim)


def _epilog() -> str:
    return f"Example:\n  mount-gateway sim nexstar:cpc --at tcp://127.0.0.1:5000 --latency 0.2\n\n{models()}"


def models() -> str:
    """Every model of both protocols, and the versions it was made with."""
    lines = ["models, and versions of the hand control (the last one is the default; others are possible):"]
    for protocol in PROTOCOLS:
        for name, row in load(protocol).models.items():
            lines.append(f"  {protocol}:{name:<16} {' '.join(row.get('versions', ()))}".rstrip())
    return "\n".join(lines)


def _sim(arguments: argparse.Namespace) -> int:
    from gateway.simulators import DEFAULT_MODEL, make_simulator, parse_time, running_clock

    endpoint = parse_device(arguments.device)
    if not (0 <= arguments.latency < inf and 0 < arguments.speed < inf):
        raise UserError("sim: --latency is 0 or more seconds, --speed more than 0")
    places = arguments.at or ["tcp://127.0.0.1:0"]
    if arguments.baud is not None and (arguments.baud <= 0 or all(place.startswith("tcp:") for place in places)):
        raise UserError("sim: --baud is a rate like 9600, of a serial port: --at pty:PATH")
    start = parse_time(arguments.time) if arguments.time else None
    simulator = make_simulator(endpoint, clock=running_clock(start), site=parse_site(arguments.site),
                               aligned=not arguments.unaligned, speed=arguments.speed)
    name = f"{endpoint.protocol}:{endpoint.model or DEFAULT_MODEL[endpoint.protocol]}"
    return with_loop(True, lambda: _serve_simulator(simulator, name, places, arguments.latency, arguments.baud))


async def _serve_simulator(simulator: Any, name: str, places: list[str], latency: float, baud: int | None) -> int:
    from gateway.simulators import serve_simulator

    done = until_signal()
    ports = await serve_simulator(simulator, places, latency, baud)
    for port in ports:
        streams.say(f"ready {name}@{port.where}")
    await done.wait()
    for port in ports:
        await port.close()
    return 0
