"""The product as processes: a simulated hand control, and the gateway in front of it."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import NamedTuple

from .hand_control import HandControl
from .processes import Workshop
from .sky import NIGHT, Site

PRODUCT = (sys.executable, "-m", "gateway")


class Endpoint(NamedTuple):
    """What a `ready PROTOCOL:MODEL@WHERE` line names."""

    speaks: str
    where: str

    @property
    def port(self) -> int:
        """The TCP port of `tcp://HOST:PORT`."""
        return int(self.where.rpartition(":")[2])

    @property
    def path(self) -> str:
        """The path of `pty:PATH`."""
        return self.where.removeprefix("pty:")


def _endpoints(ready: Sequence[str]) -> list[Endpoint]:
    return [Endpoint(*line.removeprefix("ready ").split("@", 1)) for line in ready]


def start_simulator(
    workshop: Workshop, mount: str, site: Site, *, speed: float = 1.0, aligned: bool = True
) -> tuple[Endpoint, HandControl]:
    """A simulated hand control on two TCP ports: the first for the program under test, and the truth."""
    anywhere = "tcp://127.0.0.1:0"
    argv = [*PRODUCT, "sim", mount, "--at", anywhere, "--at", anywhere, "--speed", f"{speed:g}"]
    argv += ["--time", NIGHT.strftime("%Y-%m-%dT%H:%M:%SZ"), f"--site={site.latitude:g},{site.longitude:g}"]
    process = workshop.start(argv if aligned else [*argv, "--unaligned"], ends_well=True)
    wire, second_wire = _endpoints(process.wait_for_lines("ready ", 2))
    truth = HandControl(second_wire.port)
    workshop.keep(truth.close)
    return wire, truth


def start_gateway(workshop: Workshop, mount: Endpoint, model: str, transport: str) -> Endpoint:
    """The gateway over a simulated mount, presenting an LX200 model through `tcp` or a `pty`."""
    where = "tcp://127.0.0.1:0" if transport == "tcp" else f"pty:{workshop.folder / 'lx200'}"
    argv = [*PRODUCT, "run", "--mount", f"nexstar@socket://127.0.0.1:{mount.port}"]
    process = workshop.start([*argv, "--surface", f"lx200:{model}@{where}"], ends_well=True)
    surface = _endpoints(process.wait_for_lines("ready ", 1))[0]
    assert surface.speaks == f"lx200:{model}", surface
    return surface
