"""A fake MQTT broker: it records what is published, and a test decides what arrives from it and what goes wrong."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import Any

from gateway.app.config.endpoints import Broker
from gateway.fleet.client import BrokerAccess
from gateway.fleet.topics import MqttMessage

NOWHERE = BrokerAccess(Broker("broker.invalid", 1883, False))
PATIENCE = 60.0


class FakeBroker:
    """``down``: an error for every connection attempt; ``mute``: publishing is not acknowledged; ``passes_on``: what is
    published is delivered back."""

    def __init__(self) -> None:
        self.published: list[MqttMessage] = []
        self.subscribed: list[str] = []
        self.wills: list[MqttMessage | None] = []
        self.down: Exception | None = None
        self.mute = self.passes_on = False
        self.client: _Client | None = None

    @asynccontextmanager
    async def connect(self, will: MqttMessage | None) -> AsyncIterator[Any]:
        self.wills.append(will)
        if self.down is not None:
            raise self.down
        self.client = _Client(self)
        try:
            yield self.client
        finally:
            self.client = None

    def say(self, topic: str, payload: bytes, retain: bool = False, times: int = 1) -> None:
        """Deliver a message to the client."""
        self._put(*[SimpleNamespace(topic=topic, payload=payload, retain=retain)] * times)

    def lose(self) -> None:
        """Break the connection."""
        self._put(OSError("the connection is lost"))

    def _put(self, *what: object) -> None:
        client = self.client
        assert client is not None
        for one in what:
            client.loop.call_soon_threadsafe(client.queue.put_nowait, one)

    def payloads(self, topic: str) -> list[bytes]:
        """Return the payloads that were published on this topic, in order."""
        return [message.payload for message in list(self.published) if message.topic == topic]


class _Client:
    def __init__(self, broker: FakeBroker) -> None:
        self.broker, self.loop = broker, asyncio.get_running_loop()
        self.queue: asyncio.Queue[Any] = asyncio.Queue()

    @property
    def messages(self) -> AsyncIterator[Any]:
        return self._messages()

    async def _messages(self) -> AsyncIterator[Any]:
        while True:
            one = await self.queue.get()
            if isinstance(one, Exception):
                raise one
            yield one

    async def subscribe(self, topics: Sequence[str]) -> None:
        self.broker.subscribed = list(topics)

    async def publish(self, topic: str, payload: bytes, qos: int, retain: bool) -> None:
        assert qos in (0, 1)
        while self.broker.mute:
            await asyncio.sleep(0.005)
        self.broker.published.append(MqttMessage(topic, payload, retain))
        if self.broker.passes_on:
            self.queue.put_nowait(SimpleNamespace(topic=topic, payload=payload, retain=False))


async def until(holds: Any) -> None:
    """Wait until ``holds()`` is true. Raises TimeoutError after ``PATIENCE`` seconds."""
    async with asyncio.timeout(PATIENCE):
        while not holds():
            await asyncio.sleep(0.005)
