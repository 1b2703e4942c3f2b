"""astropy without the network and without a home: `go_offline` comes before anything else of astropy is imported.

Left to itself astropy looks for new leap seconds and a new table of the Earth's rotation on the Internet when those
installed have grown old, and for settings in the user's home. Observatories are offline, a service may have no home,
and nothing here may wait: what is installed is used, however old, and the same on every computer.
"""

from __future__ import annotations

import os
from pathlib import Path


def go_offline() -> None:
    """From now on astropy fetches nothing, reads and writes no settings, and warns of nothing that has grown old."""
    os.environ["ASTROPY_CONFIG_DIR"] = str(Path(__file__).parent)  # a folder that exists and holds no settings
    from astropy.utils.iers import conf  # two tenths of a second: only who needs astropy waits for it

    conf.auto_download = False
    conf.auto_max_age = None
    conf.system_leap_second_file = conf.iers_leap_second_auto_url = conf.ietf_leap_second_auto_url = ""
