"""Point a mount at a few places from a script without an event loop, here a simulated mount and nothing that listens.

Run it: ``.venv/bin/python examples/point_from_a_script.py``. To move a real mount, write ``"nexstar@/dev/ttyUSB0"`` for
``"nexstar@sim"`` and delete the lines from ``site`` to ``speed``: they turn off the limits of altitude and Sun.
Leaving the ``with`` block stops the mount, also by Ctrl-C.
"""

from __future__ import annotations

import sys
from datetime import UTC, datetime

from gateway import Fault, UserError, op, open_blocking_gateway

#: Right ascension and declination of date, degrees.
PLACES = {"Messier 81": (149.49, 68.94), "Polaris": (46.6, 89.37), "nowhere": (float("nan"), 20.0)}


def main() -> None:
    with open_blocking_gateway(
        "nexstar@sim",
        site=(48.1, 11.6),  # degrees, north and east positive
        lowest=-90,  # for the simulation only: no lowest altitude, so that every place is allowed at any time of day
        sun=0,  # for the simulation only: nothing keeps the tube from the Sun
        speed=20,  # a simulated mount that slews 20 times faster than a real one
    ) as mount:
        mount.ready()
        identity = mount.perform(op.GetIdentity())
        site, now = mount.site(), datetime.fromtimestamp(mount.time().unix, UTC)
        print(f"{identity.product} {identity.version} at {site.latitude:.2f}, {site.longitude:.2f}; {now:%H:%M} UTC")
        for name, (ra, dec) in PLACES.items():
            try:
                mount.goto(ra, dec)
                there = mount.arrived(seconds=60)
            except (Fault, TimeoutError) as error:  # refused, stopped, or not there in time: go on with the next one
                print(f"{name}: {error}")
                continue
            print(f"{name}: arrived at {there[0]:.2f}, {there[1]:.2f}")


if __name__ == "__main__":
    try:
        main()
    except UserError as error:  # a mistake in the settings, or a port that cannot be opened
        sys.exit(str(error))
    except KeyboardInterrupt:
        sys.exit("the mount was stopped")
