"""RFC 2217 from end to end, with ser2net as server and as client, and INDI's drivers at the end of it.

A mount on a serial port of another computer, a gateway that reaches it through ser2net, and a program on a third one
whose virtual serial port ser2net makes of the gateway's RFC 2217 surface:

    simulated mount on a pty - ser2net - gateway - ser2net - pty - INDI
"""

from __future__ import annotations

import datetime

from . import scenario
from .hand_control import HandControl
from .meade import Meade
from .processes import Workshop, accepts, free_port, requires, wait_until
from .product import OF_ANOTHER_NIGHT, PRODUCT, Endpoint, endpoints
from .sky import NIGHT, NORTH, target_up
from .telescope import Telescope

SPEED = 6.0
"""How much faster than life the simulated mount slews."""


def ser2net(workshop: Workshop, name: str, accepter: str, connector: str) -> None:
    """One ser2net with one connection."""
    settings = workshop.folder / f"{name}.yaml"
    settings.write_text(f"connection: &{name}\n  accepter: {accepter}\n  connector: {connector}\n")
    workshop.start(["ser2net", "-n", "-d", "-c", str(settings)])


def far_mount(workshop: Workshop, mount: str, *more: str) -> tuple[int, Endpoint]:
    """A simulated mount on a serial port behind ser2net: the RFC 2217 port, and a second way to it, for the truth."""
    device = workshop.folder / "mount"
    argv = [*PRODUCT, "sim", mount, *more, "--at", f"pty:{device}", "--at", "tcp://127.0.0.1:0", "--speed", str(SPEED)]
    argv += ["--time", NIGHT.strftime("%Y-%m-%dT%H:%M:%SZ"), f"--site={NORTH.latitude:g},{NORTH.longitude:g}"]
    process = workshop.start(argv, ends_well=True)
    _, second = endpoints(process.wait_for_lines("ready ", 2))
    port = free_port()
    ser2net(workshop, "far", f"telnet(rfc2217),tcp,127.0.0.1,{port}", f"serialdev,{device},9600n81,local")
    wait_until("ser2net listens", lambda: accepts(port))
    return port, second


def virtual_port(workshop: Workshop, mount: str, port: int, surface: str) -> Endpoint:
    """The gateway between two RFC 2217 connections, and the serial port that ser2net makes of the second one."""
    argv = [
        *PRODUCT,
        "run",
        "--no-console",
        "--mount",
        f"{mount}@rfc2217://127.0.0.1:{port}",
        "--surface",
        f"{surface}@rfc2217://127.0.0.1:0",
        "--speed",
        f"{SPEED:g}",
        *OF_ANOTHER_NIGHT,
    ]
    (ready,) = endpoints(workshop.start(argv, ends_well=True).wait_for_lines("ready ", 1))
    assert ready.where.startswith("rfc2217://127.0.0.1:") and ready.port > 0
    device = workshop.folder / "surface"
    ser2net(workshop, "near", f"conacc,pty(link={device},raw)", f"telnet(rfc2217),tcp,127.0.0.1,{ready.port}")
    wait_until("ser2net makes a serial port", device.exists)
    return Endpoint(ready.speaks, f"pty:{device}")


def test_indi_lx200_drives_a_hand_control_over_rfc2217(workshop: Workshop) -> None:
    requires("ser2net", "indiserver", "indi_lx200autostar")
    port, second = far_mount(workshop, "nexstar:6-8se")
    truth = HandControl(second.port)
    workshop.keep(truth.close)
    surface = virtual_port(workshop, "nexstar", port, "lx200:autostar")
    telescope = Telescope(workshop, "indi_lx200autostar", "LX200 Autostar", surface)
    scenario.shows_position(telescope, truth)
    scenario.goes_to(telescope, truth, target_up(truth.position(), 50.0, NORTH), exact_end=True)
    scenario.syncs(telescope, truth)
    scenario.aborts(telescope, truth, target_up(truth.position(), 70.0, NORTH))


def test_indi_celestron_drives_a_meade_over_rfc2217(workshop: Workshop) -> None:
    """Binary commands: an hour west of Greenwich is a 0xFF among them, which Telnet must double both ways."""
    requires("ser2net", "indiserver", "indi_celestron_gps")
    port, second = far_mount(workshop, "lx200:lx200gps", "--unaligned")  # else this driver sets no clock
    truth = Meade(second.port)
    workshop.keep(truth.close)
    surface = virtual_port(workshop, "lx200", port, "nexstar:6-8se")
    first = Telescope(workshop, "indi_celestron_gps", "Celestron GPS", surface)
    scenario.shows_position(first, truth)
    first.set_clock(NIGHT + datetime.timedelta(hours=5), -1)
    first.end()
    second_run = Telescope(workshop, "indi_celestron_gps", "Celestron GPS", surface)
    told, offset = second_run.clock()
    assert offset == -1
    assert abs((told - NIGHT).total_seconds() - 5 * 3600) < 60
