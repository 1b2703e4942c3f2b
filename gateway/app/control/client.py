"""The side that asks: one request to one gateway, repeated until it is answered or the time is up."""

from __future__ import annotations

import asyncio

from gateway.app.control.exchange import ControlEndpoint, Parts, draw, seal, unseal
from gateway.system.processes import exists, is_gateway, suspended

#: Seconds from one time that a question is sent to the next: a datagram may be lost.
AGAIN = 0.5
#: Seconds within which a gateway that is well has said that it heard.
HEARD = 3.0


class _Asking(asyncio.DatagramProtocol):
    """``done`` is the answer, or what the system said; ``heard`` whether anything came from the gateway."""

    def __init__(self, secret: str, number: str) -> None:
        self._secret, self._number, self._parts = secret, number, Parts()
        self.heard = False
        self.done: asyncio.Future[str] = asyncio.get_running_loop().create_future()

    def datagram_received(self, data: bytes, addr: object) -> None:
        """A part of the answer, or noise."""
        found = unseal(self._secret, data)
        if found is not None and found[0] == self._number:
            self.heard = True
            answer = self._parts.add(found[1])
            if answer is not None and not self.done.done():
                self.done.set_result(answer)

    def error_received(self, exc: Exception) -> None:
        """Nobody has that port."""
        if not self.done.done():
            self.done.set_exception(exc)


def silent(pid: int) -> str:
    """What a gateway that does not answer may be, and what to do about it."""
    ended = f"end it with kill -9 {pid}, then mount-gateway stop stops its mount without it"
    goes_on = f"it is suspended (Ctrl-Z?), and kill -CONT {pid} lets it go on; or " if suspended(pid) else ""
    return f"the gateway (process {pid}) does not answer: {goes_on}{ended}"


async def ask(door: ControlEndpoint, word: str, seconds: float) -> str | None:
    """-> the gateway's answer, or ``failed REASON``; None where no gateway is at this endpoint any more."""
    number = draw()
    loop = asyncio.get_running_loop()
    try:
        transport, asking = await loop.create_datagram_endpoint(
            lambda: _Asking(door.secret, number), remote_addr=("127.0.0.1", door.port)
        )
    except (OSError, OverflowError) as error:
        return f"failed the gateway (process {door.pid}) cannot be reached: {error}"
    try:
        async with asyncio.timeout(seconds):
            silence = loop.time() + HEARD
            while not asking.done.done():
                if not asking.heard and loop.time() > silence:
                    raise TimeoutError
                transport.sendto(seal(door.secret, number, f"ask {word}"))
                await asyncio.wait({asking.done}, timeout=AGAIN)
        return asking.done.result()
    except ConnectionError:
        return f"failed {silent(door.pid)}" if is_gateway(door.pid) else None
    except (OSError, TimeoutError):
        return f"failed {silent(door.pid)}" if exists(door.pid) else None
    finally:
        transport.close()
