"""The product as processes: a simulated hand control or Meade, and the gateway in front of it."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from typing import NamedTuple

from tests.support.process import GATEWAY

from .alpaca_server import AlpacaServer
from .hand_control import HandControl
from .meade import Meade
from .processes import Workshop
from .sky import NIGHT, Site
from .synscan import SynScan

PRODUCT = tuple(GATEWAY)
#: The mount's night is long past: today's Sun would count as well, and this computer's clock contradicts the mount's.
OF_ANOTHER_NIGHT = ("--sun", "0", "--computer-clock", "doubtful")


class Endpoint(NamedTuple):
    """What a `ready PROTOCOL:MODEL@WHERE` line names; `speed` times faster than a real mount."""

    speaks: str
    where: str
    speed: float = 1.0

    @property
    def port(self) -> int:
        """The TCP port of `tcp://HOST:PORT`."""
        return int(self.where.rpartition(":")[2])

    @property
    def path(self) -> str:
        """The path of `pty:PATH`."""
        return self.where.removeprefix("pty:")


def endpoints(ready: Sequence[str]) -> list[Endpoint]:
    """What `ready` lines name."""
    return [Endpoint(*line.removeprefix("ready ").split("@", 1)) for line in ready]


def _simulator(
    workshop: Workshop,
    mount: str,
    site: Site,
    speed: float,
    aligned: bool,
    *more: str,
    moment: datetime.datetime = NIGHT,
) -> tuple[Endpoint, Endpoint]:
    """A simulated mount on two TCP ports."""
    anywhere = "tcp://127.0.0.1:0"
    argv = [*PRODUCT, "sim", mount, "--at", anywhere, "--at", anywhere, "--speed", f"{speed:g}"]
    argv += ["--time", moment.strftime("%Y-%m-%dT%H:%M:%SZ"), f"--site={site.latitude:g},{site.longitude:g}", *more]
    process = workshop.start(argv if aligned else [*argv, "--unaligned"], ends_well=True)
    wire, second_wire = endpoints(process.wait_for_lines("ready ", 2))
    return wire._replace(speed=speed), second_wire


def start_simulator(
    workshop: Workshop,
    mount: str,
    site: Site,
    *,
    speed: float = 1.0,
    aligned: bool = True,
    moment: datetime.datetime = NIGHT,
) -> tuple[Endpoint, HandControl]:
    """A simulated hand control on two TCP ports: the first for the program under test, and the truth."""
    wire, second_wire = _simulator(workshop, mount, site, speed, aligned, moment=moment)
    truth = (SynScan if "synscan" in mount else HandControl)(second_wire.port, "starsense" in mount)
    workshop.keep(truth.close)
    return wire, truth


def start_meade(
    workshop: Workshop, model: str, site: Site, *, speed: float = 1.0, aligned: bool = True, tolerant: bool = False
) -> tuple[Endpoint, Meade]:
    """A simulated Meade on two TCP ports: the first for the program under test, and the truth.

    Programs that are connected without a gateway send some values in spellings of their own: for a tolerant one.
    """
    more = ["--tolerant"] if tolerant else []
    wire, second_wire = _simulator(workshop, f"lx200:{model}", site, speed, aligned, *more)
    truth = Meade(second_wire.port)
    workshop.keep(truth.close)
    return wire, truth


def _gateway(workshop: Workshop, protocol: str, mount: Endpoint, surface: str, transport: str) -> Endpoint:
    """The gateway over a mount of one protocol, presenting a surface through `tcp` or a `pty`."""
    where = "tcp://127.0.0.1:0" if transport == "tcp" else f"pty:{workshop.folder / 'surface'}"
    argv = [
        *PRODUCT,
        "run",
        "--no-console",
        "--mount",
        f"{protocol}@{'http' if protocol == 'alpaca' else 'socket'}://127.0.0.1:{mount.port}",
        "--speed",
        f"{mount.speed:g}",
        "--surface",
        f"{surface}@{where}",
    ]
    argv += OF_ANOTHER_NIGHT
    process = workshop.start(argv, ends_well=True)
    return endpoints(process.wait_for_lines("ready ", 1))[0]


def start_alpaca_server(workshop: Workshop, kind: str, site: Site, *, speed: float) -> tuple[Endpoint, AlpacaServer]:
    """A simulated Alpaca server on two TCP ports: the first for the program under test, and the truth."""
    wire, second_wire = _simulator(workshop, f"alpaca:{kind}", site, speed, True)
    return wire, AlpacaServer(second_wire.port)


def start_gateway(
    workshop: Workshop, mount: Endpoint, model: str, transport: str, protocol: str = "nexstar"
) -> Endpoint:
    """The gateway over a simulated hand control, or a mount of another protocol, presenting an LX200 model."""
    surface = _gateway(workshop, protocol, mount, f"lx200:{model}", transport)
    assert surface.speaks == f"lx200:{model}", surface
    return surface


def start_celestron_gateway(workshop: Workshop, mount: Endpoint, transport: str, model: str = "") -> Endpoint:
    """The gateway over a simulated Meade, presenting the model that suits the mount it finds, or the one named."""
    return _gateway(workshop, "lx200", mount, f"nexstar{':' * bool(model)}{model}", transport)


def start_synscan_gateway(workshop: Workshop, mount: Endpoint, protocol: str, transport: str) -> Endpoint:
    """The gateway over a simulated mount of a protocol, presenting the SynScan that suits the mount."""
    return _gateway(workshop, protocol, mount, "nexstar:synscan", transport)


def start_any_gateway(workshop: Workshop, mount: Endpoint, protocol: str) -> Endpoint:
    """The gateway over a simulated mount of a protocol, for programs of every protocol and browsers."""
    at = f"{protocol}@socket://127.0.0.1:{mount.port}"
    argv = [*PRODUCT, "run", "--mount", at, "--surface", "any@tcp://127.0.0.1:0", "--console", "tcp://127.0.0.1:0"]
    argv += ["--speed", f"{mount.speed:g}"]
    process = workshop.start([*argv, *OF_ANOTHER_NIGHT, "--log"], ends_well=True)
    surface, _ = process.wait_for_lines("ready ", 2)  # the console is the other
    return endpoints([surface])[0]


def start_stellarium_gateway(workshop: Workshop, mount: Endpoint, protocol: str) -> Endpoint:
    """The gateway over a simulated mount of a protocol, for Stellarium's own."""
    surface = _gateway(workshop, protocol, mount, "stellarium", "tcp")
    assert surface.speaks == "stellarium", surface
    return surface
