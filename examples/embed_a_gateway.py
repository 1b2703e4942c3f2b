"""Run a gateway inside a program, over a simulated mount, and point it.

Run it: ``.venv/bin/python examples/embed_a_gateway.py``. To move a real mount, write ``"nexstar@/dev/ttyUSB0"`` for
``"nexstar@sim"`` and delete the lines from ``site`` to ``speed``: they turn off the limits of altitude and Sun.
Leaving the ``async with`` block stops the mount, also after an exception.
"""

from __future__ import annotations

import asyncio
import sys

from gateway import Fault, UserError, open_gateway


async def main() -> None:
    async with open_gateway(
        "nexstar@sim",
        ["lx200@tcp://127.0.0.1:0"],  # port 0: any free port
        site=(48.1, 11.6),  # degrees, north and east positive
        lowest=-90,  # for the simulation only: no lowest altitude, so that the target is allowed at any time of day
        sun=0,  # for the simulation only: nothing keeps the tube from the Sun
        speed=20,  # a simulated mount that slews 20 times faster than a real one
        warn=lambda text: print(f"note: {text}", file=sys.stderr),
    ) as mount:
        await mount.ready()
        print("programs connect to", *await mount.addresses())
        ra, dec = await mount.position()
        try:
            await mount.goto(ra + 20.0, dec / 2)
            there = await mount.arrived(seconds=60)
        except (Fault, TimeoutError) as error:  # refused, ended before its goal, or not there in time
            print(error)
            return
        print(f"arrived at right ascension {there[0]:.3f}, declination {there[1]:.3f} degrees")


if __name__ == "__main__":
    try:
        asyncio.run(main())
    except UserError as error:  # a mistake in the settings, or a port that cannot be opened
        sys.exit(str(error))
    except KeyboardInterrupt:
        sys.exit("the gateway has ended, and its mount was stopped")
