"""Publishes the mounts of one gateway on a broker, once a second if something has changed, and takes orders from it.

This costs the mounts no exchange. Programs are served between two mounts; all changes of a round are sent together.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import Any

import msgspec

from gateway.app.config.checks import ALL
from gateway.app.config.tables import MqttConfig
from gateway.app.gateway import Gateway
from gateway.fleet.client import Access, Connect
from gateway.fleet.link import BrokerLink
from gateway.fleet.orders import WHO, Orders
from gateway.fleet.presence import Presence
from gateway.fleet.told import Events, discovery, state
from gateway.fleet.topics import UNNAMED, Heard, Message, Topics, own_id

#: Seconds between two checks of the mounts for changes.
EVERY_SECOND = 1.0
OFF = "off"


class _Shown:
    """One mount, and what was last published of it."""

    def __init__(self, station: Station, gateway: Gateway) -> None:
        self.gateway, self.name = gateway, gateway.config.name or UNNAMED
        self._station = station
        self._state: dict[str, Any] = {}
        self._identity: tuple[object, ...] = (None,)
        topic = station.topics.of(self.name, "event")
        self.events = Events(lambda told: station.link.publish(Message(topic, told)), gateway.clock)
        self.orders = Orders(gateway, station.config.orders, lambda: station.presence.clash, self._has_become)
        gateway.wire_log.sinks.append(self.events.put)

    def _has_become(self, kind: str, words: str) -> None:
        self.events.tell(kind, WHO, words)

    def look(self) -> None:
        """Queue the state for publishing if it has changed."""
        station, now = self._station, state(self.gateway)
        if now == self._state:
            return
        self._state = now
        told = msgspec.json.encode({**now, "time": round(self.gateway.clock(), 3)})
        station.link.put(Message(station.topics.of(self.name, "state"), told, retain=True, newest=True))
        identity = (now["product"], now["model"], now["version"])
        prefix = station.config.home_assistant
        if prefix != OFF and identity != self._identity:
            self._identity = identity
            station.link.put(discovery(prefix, station.topics, self.name, now, station.config.orders))

    def close(self) -> None:
        """Stop publishing events and taking orders."""
        self.orders.close()
        self.gateway.wire_log.remove(self.events.put)


class Station:
    """All mounts of this process on the broker. ``say`` and ``warn`` show messages to the user at the terminal."""

    def __init__(
        self,
        config: MqttConfig,
        access: Access,
        gateways: Sequence[Gateway],
        say: Callable[[str], None],
        warn: Callable[[str], None],
        connect: Connect | None = None,
    ) -> None:
        self.config, self._broker, self._say, self._warn = config, access.broker, say, warn
        self.topics = Topics(config.prefix, config.id or own_id())
        self.presence = Presence(self.topics, lambda message: self.link.publish(message), warn)
        own = [self.topics.availability, self.topics.gateway, self.topics.of("+", "command"), self.topics.everyone]
        self.link = BrokerLink(
            access, own, self._hear, self._told, self.presence.greeting, self.presence.parting, connect
        )
        self._shown = {(shown := _Shown(self, gateway)).name: shown for gateway in gateways}
        self._there: bool | None = None
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin to connect and to publish."""
        self.link.start()
        self._task = asyncio.ensure_future(self._look_on())

    async def close(self) -> None:
        """Publish that this gateway ends, if the broker is connected, and disconnect."""
        if self._task is not None:
            self._task.cancel()
        for shown in self._shown.values():
            shown.close()
        await self.link.close()

    async def _look_on(self) -> None:
        while True:
            for shown in list(self._shown.values()):
                try:
                    shown.look()
                except Exception as error:  # a defect here must affect nothing but what is published of the mount
                    shown.gateway.wire_log.note_once("mqtt", f"internal error, please report it: {error!r}")
                await asyncio.sleep(0)
            self.link.send()
            await asyncio.sleep(EVERY_SECOND)

    def _hear(self, heard: Heard) -> None:
        if self.presence.hear(heard):
            return
        to = [*self.topics.parts(heard.topic), ""]
        if to[0] == ALL:
            for shown in self._shown.values():
                shown.orders.take(heard.payload, heard.retained, ALL)
        elif (one := self._shown.get(to[1])) is not None:
            one.orders.take(heard.payload, heard.retained, one.name)

    def _told(self, there: bool, why: str) -> None:
        """Tell the user when the broker is connected or lost."""
        if there and self._there is None:
            self._say(f"ready broker {self._broker} as {self.topics.prefix}/{self.topics.id}")
        elif there and not self._there:
            self._warn(f"the broker {self._broker} is connected again")
        elif not there and self._there is not False:
            self._warn(
                f"the broker {self._broker} cannot be reached: {why}. The mounts and their programs are not "
                "affected; the gateway keeps trying"
            )
        self._there = there
