"""What a surface tells without being asked: at its own pace, the newest only, and nothing to nobody."""

from __future__ import annotations

import asyncio
from itertools import pairwise
from typing import Any

from gateway.clients.commands.command_processor import ReadingPusher
from gateway.core.errors import NoAnswer
from gateway.core.operations import Operation, Position, Slewing
from gateway.protocols.base.wants import Subscription


class Client:
    """Somebody who is told things: what a reading tells is the time in whole seconds."""

    def __init__(self, *subscriptions: Subscription, takes: float = 0.0) -> None:
        self.loop = asyncio.get_running_loop()
        self.began = self.loop.time()
        self.takes = takes
        self.heard: list[tuple[float, bytes]] = []
        self.waiting = 0
        self.down = False
        self.tasks: list[asyncio.Task[Any]] = []
        self.pushes = ReadingPusher(subscriptions, self.read, self.send, lambda: self.waiting, self.spawn)

    def spawn(self, work: Any) -> asyncio.Task[Any]:
        self.tasks.append(self.loop.create_task(work))
        return self.tasks[-1]

    @property
    def now(self) -> float:
        return round(self.loop.time() - self.began, 3)

    async def read(self, operation: Operation) -> int:
        await asyncio.sleep(self.takes)
        if self.down:
            raise NoAnswer
        return int(self.now)

    def send(self, data: bytes) -> None:
        self.heard.append((self.now, data))


def told(value: Any) -> bytes:
    return b"%d" % value


async def test_surface_pushes_at_the_interval_of_each_client() -> None:
    client = Client(Subscription(Position(), 0.5, told), Subscription(Slewing(), 2.0, lambda value: b"s"))
    await asyncio.sleep(2.1)
    assert [at for at, data in client.heard if data != b"s"] == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert [at for at, data in client.heard if data == b"s"] == [0.0, 2.0]
    client.pushes.close()
    await asyncio.sleep(2.0)
    assert len(client.heard) == 7
    assert all(task.cancelled() for task in client.tasks)


async def test_surface_pushes_only_on_change_where_configured() -> None:
    client = Client(Subscription(Position(), 0.25, told, only_changes=True))
    await asyncio.sleep(2.1)
    assert client.heard == [(0.0, b"0"), (1.0, b"1"), (2.0, b"2")]
    client.pushes.close()


async def test_client_that_reads_late_gets_only_the_newest_push() -> None:
    client = Client(Subscription(Position(), 0.5, told))
    await asyncio.sleep(0.1)
    client.waiting = 24
    await asyncio.sleep(5.0)
    assert len(client.heard) == 1, "nothing is piled up"
    client.waiting = 0
    await asyncio.sleep(0.5)
    assert client.heard[1:] == [(5.5, b"5")]
    client.pushes.close()


async def test_push_skips_unknown_values_and_does_not_catch_up_after_a_slow_answer() -> None:
    client = Client(Subscription(Position(), 0.5, told), takes=0.7)
    client.down = True
    await asyncio.sleep(3.0)
    assert client.heard == []
    client.down = False
    await asyncio.sleep(3.0)
    times = [at for at, _ in client.heard]
    assert [round(later - at, 3) for at, later in pairwise(times)] == [0.7] * (len(times) - 1)
    client.pushes.close()
