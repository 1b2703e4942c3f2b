"""Keep astropy off the network and out of the user's home: call `go_offline` before importing anything of astropy.

By default astropy looks for new leap seconds and new Earth rotation tables on the Internet when the installed ones are
old, and for settings in the user's home. Observatories are offline, a service may have no home folder, and nothing
in this package may wait. So the gateway uses the installed data, however old: results are equal on all computers.
"""

from __future__ import annotations

import os
from pathlib import Path


def go_offline() -> None:
    """Configure astropy not to download, use settings or warn of old data. Raises ImportError without astropy."""
    os.environ["ASTROPY_CONFIG_DIR"] = str(Path(__file__).parent)  # a folder that exists and holds no settings
    from astropy.utils.iers import conf  # takes 0.2 s, so it is imported only when needed

    conf.auto_download = False
    conf.auto_max_age = None
    conf.system_leap_second_file = conf.iers_leap_second_auto_url = conf.ietf_leap_second_auto_url = ""
