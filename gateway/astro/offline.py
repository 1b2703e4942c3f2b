"""astropy without the network: `go_offline` comes before the first import of `astropy.coordinates` or `astropy.time`.

Left to itself astropy looks for new leap seconds and a new table of the Earth's rotation on the Internet when those
installed have grown old. Observatories are offline, and nothing here may wait: what is installed is used, however old.
"""

from __future__ import annotations


def go_offline() -> None:
    """Nothing is fetched from now on, and nobody is warned that what is installed has grown old."""
    from astropy.utils.iers import conf  # two tenths of a second: only who needs astropy waits for it

    conf.auto_download = False
    conf.auto_max_age = None
