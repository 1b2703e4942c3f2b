"""Stellarium on a display of its own, with the plug-in Telescope Control set to one telescope or several.

Its files lie in a folder of the test's. A script of its own selects a star and says when it is done; a key press is
what a person would type. (Asking for a telescope in a script makes version 0.22 end.)
"""

from __future__ import annotations

import configparser
import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from .display import start_display
from .processes import Workshop, requires, wait_until
from .sky import NIGHT, Site

#: The settings that it comes with: it ends at the start without some of them.
SETTINGS = Path("/usr/share/stellarium/data/default_cfg.ini")
#: The form of its list of telescopes: a list of any other is set aside at the start.
LIST = "0.4.1"
#: Seconds until it has come up without a graphics card.
STARTS = 150.0
SCRIPT = """\
core.setObserverLocation({longitude}, {latitude}, 100.0, 0.0, "Here", "Earth");
core.setDate("{night:%Y-%m-%dT%H:%M:%S}", "utc");
core.selectObjectByName("{star}", false);
core.debug("selected");
"""


def _files(home: Path, ports: Sequence[int], star: str, site: Site) -> None:
    """Its settings, its list of telescopes, its script. It draws little and seldom: nobody looks."""
    settings = configparser.RawConfigParser(strict=False)
    settings.optionxform = str  # type: ignore[assignment,method-assign]
    settings.read(SETTINGS)
    for section, key, value in [
        ("main", "version", "0.22.2"),
        ("plugins_load_at_startup", "TelescopeControl", "true"),
        ("video", "fullscreen", "false"),
        ("video", "screen_w", "800"),
        ("video", "screen_h", "600"),
        ("video", "maximum_fps", "4"),
        ("video", "minimum_fps", "2"),
        ("landscape", "flag_landscape", "false"),
        ("landscape", "flag_atmosphere", "false"),
        ("astro", "flag_milky_way", "false"),
        ("scripts", "startup_script", "test.ssc"),
        ("init_location", "location", f"{site.latitude}, {site.longitude}"),
    ]:
        if not settings.has_section(section):
            settings.add_section(section)
        settings.set(section, key, value)
    telescopes = {
        str(number): {
            "name": f"gateway {number}",
            "connection": "remote",
            "equinox": "J2000",
            "host_name": "127.0.0.1",
            "tcp_port": port,
            "delay": 500000,
            "connect_at_startup": True,
        }
        for number, port in enumerate(ports, 1)
    }
    plugin, scripts = home / "modules" / "TelescopeControl", home / "scripts"
    plugin.mkdir(parents=True)
    scripts.mkdir()
    (plugin / "telescopes.json").write_text(json.dumps({"version": LIST, **telescopes}))
    (scripts / "test.ssc").write_text(
        SCRIPT.format(longitude=site.longitude, latitude=site.latitude, night=NIGHT, star=star)
    )
    with (home / "config.ini").open("w") as file:
        settings.write(file, space_around_delimiters=False)


class Planetarium:
    """The program, with a star selected and a telescope at each of these TCP ports of this machine."""

    def __init__(self, workshop: Workshop, ports: Sequence[int], star: str, site: Site) -> None:
        requires("stellarium", "Xvfb", "xdotool")
        home = workshop.folder / "home"
        self._workshop = workshop
        _files(home / ".stellarium", ports, star, site)
        self._environment = start_display(workshop, home, (1024, 768))
        self._program = workshop.start(["stellarium"], self._environment)
        wait_until("the star is selected", self._selected, STARTS)

    def _selected(self) -> bool:
        """Whether its script has come to its end."""
        if not self._program.running():
            pytest.fail(f"Stellarium ended early:\n{self._program.output()[-2000:]}")
        return "selected" in self._program.output()

    def slew(self, number: int) -> None:
        """Ctrl and a number, from 1: that telescope to what is selected."""
        self._workshop.start(["xdotool", "mousemove", "400", "300", "key", f"ctrl+{number}"], self._environment)
