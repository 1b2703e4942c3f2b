"""Points a mount as SkySafari does, without a phone: a connection for every command, a goto, then its position.

Run it beside ``mount-gateway demo``: ``python examples/like_skysafari.py 127.0.0.1 4030 05:34:32 +22*00:52``. Without
arguments it starts a gateway over a simulated mount for itself. It needs nothing but Python.
"""

from __future__ import annotations

import asyncio
import sys


async def ask(where: tuple[str, int], command: str, until: str = "#") -> str:
    """Return the reply to one command, over a connection of its own. The reply to ``:MS#`` is 0, or 1 and a reason."""
    async with asyncio.timeout(10):
        reader, writer = await asyncio.open_connection(*where)
        try:
            writer.write(command.encode())
            reply = (await reader.readexactly(1)).decode()
            while until and not reply.endswith("#") and (until, reply) != ("0#", "0"):
                reply += (await reader.readexactly(1)).decode()
        finally:
            writer.close()
            await writer.wait_closed()
    return reply.rstrip("#")


async def point(where: tuple[str, int], ra: str, dec: str) -> None:
    """Go to a position like the GoTo button, and print positions until the mount rests, at the target or stopped."""
    for command in (f":Sr{ra}#", f":Sd{dec}#"):
        if await ask(where, command, until="") != "1":
            raise SystemExit(f"{command} is not accepted; write 05:34:32 and +22*00:52")
    if (refused := await ask(where, ":MS#", until="0#")) != "0":
        raise SystemExit(f"the gateway refuses the goto: {refused[1:]}")
    while await ask(where, ":D#"):
        print(f"slewing: {await ask(where, ':GR#')} {await ask(where, ':GD#')}", flush=True)
        await asyncio.sleep(0.5)
    print(f"at rest: {await ask(where, ':GR#')} {await ask(where, ':GD#')}")


async def alone() -> None:
    """Use a simulated mount that is twenty times as fast as a real one."""
    from gateway import open_gateway

    async with open_gateway("nexstar@sim", ["lx200@tcp://127.0.0.1:0"], speed=20, sun=0.0) as gateway:
        await gateway.ready()
        host, _, port = (await gateway.addresses())[0].rpartition("tcp://")[2].rpartition(":")
        await point((host, int(port)), "09:57:58", "+68*56:10")


if __name__ == "__main__":
    if len(sys.argv) != 1 and not (len(sys.argv) == 5 and sys.argv[2].isdecimal()):
        print("usage: like_skysafari.py [HOST PORT RIGHT_ASCENSION DECLINATION]", file=sys.stderr)
        sys.exit(2)
    try:
        asyncio.run(point((sys.argv[1], int(sys.argv[2])), *sys.argv[3:]) if len(sys.argv) > 1 else alone())
    except KeyboardInterrupt:
        sys.exit("ended; a goto goes on: mount-gateway stop, or STOP in a program, ends it")
    except OSError as error:
        sys.exit(f"no answer from {' '.join(sys.argv[1:3])}: {error}")
