"""Makes the pictures of Stellarium in docs/programs/stellarium.md, from the real program at a simulated mount.

    python docs/tools/stellarium_pictures.py

It writes docs/pictures/stellarium*.png. It needs the extra ``test`` and Debian's ``stellarium``, ``xvfb`` and
``xdotool``; the program is started and operated as in the tests.
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
from tests.programs import stellarium  # noqa: E402
from tests.programs.processes import Workshop, wait_until  # noqa: E402
from tests.programs.product import start_simulator, start_stellarium_gateway  # noqa: E402
from tests.programs.sky import NORTH  # noqa: E402

#: Settings that the tests' script does not need: a dark sky with few labels, and the star in its middle.
LOOKS = """\
LandscapeMgr.setFlagAtmosphere(false);
ConstellationMgr.setFlagLines(true);
core.setGuiVisible(false);
core.selectObjectByName("{star}", false);
core.moveToSelectedObject(0.1);
StelMovementMgr.zoomTo(40, 0.1);
core.wait(1);
core.debug("selected");
"""
WINDOW = (0, 64, 800, 600)
FORM = (130, 54, 668, 546)


def main() -> None:
    stellarium.SCRIPT = "\n".join([*stellarium.SCRIPT.splitlines()[:2], LOOKS])
    with tempfile.TemporaryDirectory() as folder:
        os.environ["STATE_DIRECTORY"] = folder
        (Path(folder) / "home").mkdir()
        workshop = Workshop(Path(folder))
        try:
            wire, truth = start_simulator(workshop, "nexstar:6-8se", NORTH, speed=4.0)
            surface = start_stellarium_gateway(workshop, wire, "nexstar")
            program = stellarium.Planetarium(workshop, surface.port, "Aldebaran", NORTH)
            os.environ["DISPLAY"] = program._environment["DISPLAY"]
            program.slew()
            wait_until("the slew", truth.goto_running, 20.0)
            time.sleep(3.0)
            picture("stellarium", WINDOW, os.environ["DISPLAY"])
            wait_until("arrival", lambda: not truth.goto_running(), 120.0)
            form()
        finally:
            workshop.close()


def form() -> None:
    """Open the form for a telescope: Ctrl+0, *Configure telescopes*, *Add*."""
    act("key", "ctrl+0")
    act("mousemove", "400", "494", "click", "1")
    act("mousemove", "360", "393", "click", "1")
    act("mousemove", "169", "163", "click", "1")  # External software or a remote computer
    act("mousemove", "400", "420", *["click", "5"] * 8)  # down to the connection
    act("mousemove", "570", "328", "click", "--repeat", "3", "1", "type", "10001")
    act("key", "Tab")
    picture("stellarium-telescope", FORM, os.environ["DISPLAY"])


def act(*what: str) -> None:
    """Act like a person who waits for the next window to open."""
    subprocess.run(["xdotool", *what], check=True)
    time.sleep(2.5)


if __name__ == "__main__":
    main()
