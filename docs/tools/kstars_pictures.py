"""Makes the pictures of KStars in docs/programs/kstars.md, from the real program at a simulated mount.

    python docs/tools/kstars_pictures.py

It writes docs/pictures/kstars*.png: INDI's LX200 driver moves a simulated Celestron through the gateway, and KStars
shows its position. It needs the extra ``test`` and Debian's ``kstars``, ``indi-bin``, ``xvfb``, ``xdotool`` and
``dbus``.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from docs.tools.pictures import picture  # noqa: E402
from tests.programs.display import start_display  # noqa: E402
from tests.programs.indi import IndiServer  # noqa: E402
from tests.programs.processes import Workshop, wait_until  # noqa: E402
from tests.programs.product import PRODUCT, start_simulator  # noqa: E402
from tests.programs.sky import NIGHT, NORTH  # noqa: E402

DEVICE = "LX200 Autostar"
#: The driver that the page names.
PORT = 4030
#: The star in the picture, and the target of the mount: hours and degrees of date.
STAR, THERE = "Aldebaran", (4.6242, 16.564)
SIZE = 1024, 700
#: Parts of the screen: the panel of the driver, and the map of the sky.
PANEL, SKY = (0, 0, 800, 600), (0, 0, 1024, 700)
#: Where to click in the panel.
CONNECTION, CLOSE = (177, 62), (749, 577)
SETTINGS = {
    "kstarsrc": """\
[GUI]
RunStartupWizard=false
[TipOfDay]
RunOnStart=false
[indi]
useGeographicUpdate=false
useTimeUpdate=false
""",
    "kwalletrc": "[Wallet]\nEnabled=false\nFirst Use=false\n",
}


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        os.environ["STATE_DIRECTORY"] = folder
        workshop = Workshop(Path(folder))
        try:
            wire, truth = start_simulator(workshop, "nexstar:6-8se", NORTH, speed=1.0)
            start_gateway(workshop, wire.port)
            server = IndiServer(workshop, "indi_lx200autostar")
            indi(server, "CONNECTION_MODE.CONNECTION_TCP=On")
            indi(server, f"DEVICE_ADDRESS.ADDRESS=127.0.0.1;PORT={PORT}")
            indi(server, "CONNECTION.CONNECT=On")
            program = Program(workshop)
            program.call("/KStars", "setLocalTime", *NIGHT.timetuple()[:6])
            program.call("/KStars/INDI", "INDI.connect", "127.0.0.1", server.port)
            program.call("/KStars", "lookTowards", STAR)
            program.call("/KStars", "setApproxFOV", 45)
            time.sleep(3.0)
            indi(server, f"EQUATORIAL_EOD_COORD.RA={THERE[0]};DEC={THERE[1]}")
            wait_until("the slew", truth.goto_running, 20.0)
            wait_until("arrival", lambda: not truth.goto_running(), 200.0)
            time.sleep(3.0)
            program.click(*CONNECTION)
            program.picture("kstars-connection", PANEL)
            program.click(*CLOSE)
            program.picture("kstars", SKY)
        finally:
            workshop.close()


def start_gateway(workshop: Workshop, mount: int) -> None:
    """Start it as on the page, but with the simulated mount, whose night is long past: today's Sun does not count."""
    ends = ["--mount", f"nexstar@socket://127.0.0.1:{mount}", "--surface", f"lx200@tcp://127.0.0.1:{PORT}"]
    workshop.start([*PRODUCT, "run", "--no-console", *ends, "--sun", "0"]).wait_for_lines("ready ", 1)


def indi(server: IndiServer, setting: str) -> None:
    """Set a property of the driver, as a user's script would."""
    subprocess.run(["indi_setprop", "-p", str(server.port), f"{DEVICE}.{setting}"], check=True)
    time.sleep(1.5)


class Program:
    """KStars with a display and a message bus of its own."""

    def __init__(self, workshop: Workshop) -> None:
        home = workshop.folder / "home"
        (home / ".config").mkdir(parents=True)
        (home / "run").mkdir(mode=0o700)
        for name, text in SETTINGS.items():
            (home / ".config" / name).write_text(text)
        self._environment = {
            **start_display(workshop, home, SIZE),
            "XDG_CONFIG_HOME": str(home / ".config"),
            "XDG_RUNTIME_DIR": str(home / "run"),
            "LC_ALL": "C.UTF-8",
        }
        bus = workshop.start(["dbus-daemon", "--session", "--nofork", "--print-address=1"], self._environment)
        [address] = bus.wait_for_lines("unix:", 1)
        self._environment["DBUS_SESSION_BUS_ADDRESS"] = address
        self._program = workshop.start(["kstars"], self._environment)
        wait_until("KStars is there", self._there, 60.0)
        time.sleep(4.0)

    def _there(self) -> bool:
        return "setApproxFOV" in self._ask("introspect", "--object-path", "/KStars")

    def _ask(self, *words: str) -> str:
        command = ["gdbus", words[0], "--session", "--dest", "org.kde.kstars", *words[1:]]
        environment = {**os.environ, **self._environment}
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=False).stdout

    def call(self, path: str, method: str, *values: object) -> str:
        """Call a method over the message bus."""
        words = [f'"{value}"' if isinstance(value, str) else str(value) for value in values]
        return self._ask("call", "--object-path", path, "--method", f"org.kde.kstars.{method}", *words)

    def click(self, across: int, down: int) -> None:
        """Click like a person who waits for the result."""
        command = ["xdotool", "mousemove", str(across), str(down), "click", "1"]
        subprocess.run(command, env={**os.environ, **self._environment}, check=True)
        time.sleep(2.0)

    def picture(self, name: str, part: tuple[int, int, int, int]) -> None:
        picture(name, part, self._environment["DISPLAY"])


if __name__ == "__main__":
    main()
