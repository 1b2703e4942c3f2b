"""Point the mount of a gateway that runs already, as a service or by ``mount-gateway run``, from a script.

Run it: ``.venv/bin/python examples/ask_a_running_gateway.py MOUNT``, where ``MOUNT`` is the mount's name or its port.
Without it, it starts a gateway over a simulated mount for itself, and asks that. The gateway's limits apply.
"""

from __future__ import annotations

import sys

from gateway import BlockingMount, Fault, UserError, connect_blocking, open_blocking_gateway


def point(mount: BlockingMount) -> None:
    print(f"{mount.name}: {'; '.join(mount.status().allowed)}")
    try:
        mount.goto(37.95, 89.26, j2000=True)  # Polaris
        ra, dec = mount.arrived(seconds=120)
    except (Fault, TimeoutError) as error:  # refused, stopped, or not there in time
        print(f"Polaris: {error}")
    else:
        print(f"Polaris: arrived at {ra:.2f}, {dec:.2f}")


def main() -> None:
    if len(sys.argv) > 1:
        mount = connect_blocking(sys.argv[1])
        point(mount)
        return
    with open_blocking_gateway("nexstar@sim", name="simulated", site=(48.1, 11.6), speed=20) as gateway:
        gateway.ready()
        point(connect_blocking("simulated"))


if __name__ == "__main__":
    try:
        main()
    except UserError as error:  # no gateway runs here, or several mounts have that name
        sys.exit(str(error))
    except KeyboardInterrupt:
        sys.exit("the mount goes on; mount-gateway stop stops it")
