"""``sim``: runs a simulated mount to which other programs connect."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from gateway.app.config import parse_device, parse_site
from gateway.app.config.endpoints import suggest_address
from gateway.cli.command_line import Commands
from gateway.cli.serve.serving import run_on_loop
from gateway.cli.serve.settings import errors_naming_flag
from gateway.cli.serve.signals import end_signal_event, race
from gateway.core.errors import UserError, explain_file_error, explain_os_error
from gateway.protocols.registry import PROTOCOLS
from gateway.system import streams
from gateway.system.files import open_regular_fd

if TYPE_CHECKING:
    from gateway.app.discovery.offer import Offer
    from gateway.protocols.mechanics.simulated import Simulated


def add_sim(commands: Commands) -> None:
    sim = commands.add_parser("sim", make_epilog=lambda: f"{_EPILOG}\n{models_help()}")
    sim.add_argument("device", metavar="PROTOCOL[:MODEL[/VERSION]]", help="for example nexstar:cpc/4.21")
    sim.add_argument("--at", action="append", metavar="WHERE", help="tcp://HOST:PORT or pty:PATH; may be repeated")
    sim.add_argument("--latency", type=float, default=0.0, metavar="S", help="seconds to answer (a real one: 0.1-0.3)")
    sim.add_argument(
        "--baud",
        type=int,
        metavar="N",
        help="send and receive at this baud rate, also over TCP; a pty or serial port then understands no other "
        "(default: 9600 there, unlimited over TCP)",
    )
    sim.add_argument("--speed", type=float, default=1.0, help="slews this many times faster")
    sim.add_argument("--time", metavar="ISO", help="begin at this UTC time")
    sim.add_argument("--site", metavar="LAT,LON", default="45,10", help="default 45,10")
    sim.add_argument("--unaligned", action="store_true", help="as after power-on, before the star alignment")
    sim.add_argument("--truth", metavar="FILE.jsonl", help="write what the mount physically does, ten times a second")
    for spec in PROTOCOLS.values():
        for name, effect in spec.simulator_switches.items():
            sim.add_argument(_flag(name), action="store_true", help=f"{spec.name}: {effect}")
    sim.set_defaults(run=_run_sim)


_EPILOG = """\
Several programs may connect at once, by one --at or by several: all of them talk to the same mount.
It behaves like a real one where that counts: its motors need about a second to reach full speed and run on as long
after a stop, bytes on a pty or serial port take their time, and an LX200GPS that sleeps does not move. A Meade refuses
arguments in a form that its manual does not have, as :Sg-10*45# or :SG+8#, unless it is --tolerant.

--truth writes one JSON object a line, ten times a second of its time, from the motor axes as they are and from --site
and --time. Nothing that a program tells the mount changes what site and time this goes by, and a sync does not move it:
  t                     seconds, Unix time by the simulated mount's own clock
  axis1, axis2          where the motor axes stand, degrees
  altitude, azimuth     where the tube really points, degrees, without refraction
  hour_angle            of the tube, degrees, positive west of the meridian
  past_meridian         German mounts: degrees beyond the meridian, negative before it; null on others
  sun_distance          from the Sun, up or not, degrees
  rate1, rate2          how fast the axes turn, degrees a second
  moving                whether a motor turns for anything but tracking, or still runs on after it
  tracking              whether the motors follow the sky

Examples:
  mount-gateway sim nexstar:cpc --at tcp://127.0.0.1:5000 --latency 0.2
  mount-gateway sim alpaca:german --at tcp://127.0.0.1:11111 --truth night.jsonl
  mount-gateway sim lx200:lx200gps --at pty:/tmp/meade --at tcp://127.0.0.1:5001 --truth night.jsonl
"""


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _simulator_switches(arguments: argparse.Namespace, protocol: str) -> dict[str, bool]:
    """Return the given switches of this protocol's simulator. Raises UserError for a switch of another protocol."""
    chosen = {}
    for spec in PROTOCOLS.values():
        for name in spec.simulator_switches:
            if not getattr(arguments, name):
                continue
            if spec.name != protocol:
                raise UserError(f"sim: {_flag(name)} is for {spec.name} mounts; a {protocol} mount has no such setting")
            chosen[name] = True
    return chosen


def models_help() -> str:
    """Return the help text that lists all models of all protocols, and their hand control versions."""
    lines = [
        "models, and versions of the hand control (the last number is the default; others are possible, and",
        "nexstar:starsense is a StarSense hand control on the default model, nexstar:synscan a SynScan of Sky-Watcher,",
        "nexstar:skywatcher a Celestron hand control that reports a Sky-Watcher mount; the last three of lx200 are two",
        "controllers of other makers, and any that is not known):",
    ]
    for spec in PROTOCOLS.values():
        for name, row in spec.commands.models.items():
            lines.append(f"  {spec.name}:{name:<16} {' '.join(spec.versions_of(row))}".rstrip())
    return "\n".join(lines)


def _run_sim(arguments: argparse.Namespace) -> int:
    from gateway.app.simulated import make_simulator, parse_time, running_clock

    endpoint = parse_device(arguments.device, role="mount")
    if not (0 <= arguments.latency < inf and 0 < arguments.speed < inf):
        raise UserError("sim: --latency is 0 or more seconds, --speed more than 0")
    places = arguments.at or ["tcp://127.0.0.1:0"]
    for place in places:
        if meant := suggest_address(place, True):
            raise UserError(f"sim: --at {place}: write --at {meant}")
    if arguments.baud is not None and arguments.baud <= 0:
        raise UserError("sim: --baud is a rate like 9600")
    settings = _simulator_switches(arguments, endpoint.protocol)
    with errors_naming_flag("--time"):
        start = parse_time(arguments.time) if arguments.time else None
    with errors_naming_flag("--site"):
        site = parse_site(arguments.site)
    simulator = make_simulator(
        endpoint,
        clock=running_clock(start),
        site=site,
        aligned=not arguments.unaligned,
        speed=arguments.speed,
        **settings,
    )
    spec = PROTOCOLS[endpoint.protocol]
    name = spec.endpoint_text(endpoint.model or spec.default_model, None)

    async def serve() -> int:
        return await _serve(simulator, name, places, arguments.latency, arguments.baud, arguments.truth)

    return run_on_loop(True, serve)


async def _serve(
    simulator: Simulated, model: str, addresses: list[str], latency: float, baud: int | None, truth_path: str | None
) -> int:
    from gateway.app.discovery.offer import network_offers
    from gateway.app.simulated import serve_simulator

    done = end_signal_event()
    file = None if truth_path is None else _open_truth_file(truth_path)
    ports = await serve_simulator(simulator, addresses, latency, baud)
    for port in ports:
        streams.print_line(f"ready {model}@{port.address}")
    end_discovery = await _answer_discovery(network_offers(f"{model}@{port.address}" for port in ports))
    try:
        if file is None:
            await done.wait()
        else:
            await _write_truth(simulator, file, done)
    finally:
        end_discovery()
        for port in ports:
            await port.close()
    return 0


async def _answer_discovery(offers: list[Offer]) -> Callable[[], None]:
    """Let programs discover a mount that is reached over HTTP, as real servers do; return a function that ends this."""
    web = PROTOCOLS[offers[0].protocol].web if offers else None
    try:
        return await web().answer_discovery([(offer.host, offer.port) for offer in offers]) if web else lambda: None
    except OSError as error:
        streams.print_line(f"programs will not find it by themselves: {error.strerror or error}")
        return lambda: None


def _open_truth_file(path: str) -> TextIO:
    """Open a new or emptied file that is flushed after each line, for programs that follow it. Raises UserError."""
    try:
        return open(
            path, "w", encoding="ascii", buffering=1, opener=lambda _, how: open_regular_fd(Path(path), how, 0o666)
        )
    except OSError as error:
        raise UserError(f"cannot write {path}: {explain_file_error(path, error)}") from None


async def _write_truth(simulator: Simulated, file: TextIO, done: asyncio.Event) -> None:
    """Write the true state of the mount to the file of ``--truth`` until ``done`` is set. Raises UserError."""
    from gateway.protocols.mechanics.truth import sample

    try:
        await race(done, sample(simulator, lambda truth: file.write(truth.json_line())))
        file.close()
    except OSError as error:
        raise UserError(f"cannot write {file.name}: {explain_os_error(error)}; the simulated mount has ended") from None
    finally:
        with contextlib.suppress(OSError):
            file.close()
