"""A client of a few lines: it asks any LX200 server over TCP where the telescope points.

Run it: ``python examples/tiny_client.py 127.0.0.1 4030``. Without arguments it starts a gateway over a simulated mount,
prints the traffic between that gateway and the mount, and asks that gateway.
"""

from __future__ import annotations

import asyncio
import sys

from gateway import Entry, decode_reply, encode, open_gateway


async def ask(host: str, port: int) -> tuple[float, float]:
    """Return right ascension and declination of date in degrees. Raises OSError, TimeoutError, FrameError."""
    async with asyncio.timeout(10):
        reader, writer = await asyncio.open_connection(host, port)
        try:
            found = []
            for name, field in (("GR", "ra"), ("GD", "dec")):
                writer.write(encode("lx200", name))
                reply = await reader.readuntil(b"#")
                found.append(float(str(decode_reply("lx200", name, reply).values[field])))
        finally:
            writer.close()
            await writer.wait_closed()
    return found[0], found[1]


def show(entry: Entry) -> None:
    """Print the traffic with the mount: the gateway calls this for every command and reply on either side."""
    if entry.arrow in "<>" and entry.side == "mount":
        print(f"    mount {entry.arrow} {entry.data!r}")


async def main() -> None:
    if len(sys.argv) > 1:
        print(await ask(sys.argv[1], int(sys.argv[2])))
        return
    async with open_gateway("nexstar@sim", ["lx200@tcp://127.0.0.1:0"], watch=show) as gateway:
        await gateway.ready()
        host, _, port = (await gateway.addresses())[0].partition("://")[2].rpartition(":")
        print(await ask(host, int(port)))


if __name__ == "__main__":
    if len(sys.argv) != 1 and not (len(sys.argv) == 3 and sys.argv[2].isdecimal()):
        print("usage: tiny_client.py [HOST PORT]", file=sys.stderr)
        sys.exit(2)
    try:
        asyncio.run(main())
    except KeyboardInterrupt:
        sys.exit("ended")
    except OSError as error:
        sys.exit(f"no answer from {' '.join(sys.argv[1:3])}: {error}")
