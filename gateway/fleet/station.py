"""Publishes the states of a gateway's mounts on a broker, and carries out the orders that the broker passes on.

Once a second, the states that have changed are sent together. They are made from cached readings: no mount is asked.
"""

from __future__ import annotations

import asyncio
import json
import os
import secrets
import socket
from collections.abc import Callable, Collection, Sequence
from typing import Any

import msgspec

from gateway.app.config.checks import ALL_GATEWAYS
from gateway.app.config.tables import MqttConfig
from gateway.app.gateway import Gateway
from gateway.core.about import version
from gateway.core.requests import GotoRequest, HomeRequest, Named, ParkRequest, StopRequest, UnparkRequest
from gateway.core.waiting import BackgroundTasks
from gateway.core.wire_log import printable
from gateway.fleet.client import MAX_MESSAGE_BYTES, BrokerAccess, Connect
from gateway.fleet.link import BrokerLink
from gateway.fleet.mount_messages import EventPublisher, discovery_message, published_state
from gateway.fleet.topics import DEFAULT_MOUNT_NAME, OFFLINE, ONLINE, MqttMessage, ReceivedMessage, Topics, host_id

CLIENT = "mqtt"  # the client's name in the log, for orders from the broker
#: Maximum length of an order in characters; minimum seconds between two stops that are sent to the mount.
MAX_ORDER_LENGTH, STOP_PERIOD = 100, 0.25
#: The orders without arguments, except stop.
PLAIN_ORDERS: dict[str, type[ParkRequest | UnparkRequest | HomeRequest]] = {
    "park": ParkRequest,
    "wake": UnparkRequest,
    "home": HomeRequest,
}
GOTO_ORDER = "goto"

#: Called with the result of an order: ``done`` or ``failed``, and a message.
Report = Callable[[str, str], None]


class OrderRunner:
    """Carries out the broker's orders for one mount: ``allowed`` ones and stops. The limits of the gateway apply.

    A stop does not wait for other orders. An order with the retain flag is refused: the broker stores it, and it would
    be carried out again at every connection. ``conflict`` returns why only stops are carried out now, or "".
    """

    def __init__(self, gateway: Gateway, allowed: Collection[str], conflict: Callable[[], str], report: Report) -> None:
        self._gateway, self._allowed_orders, self._conflict_message, self._report = gateway, allowed, conflict, report
        self._loop = asyncio.get_running_loop()
        self._last_stop_time = -1e9
        self._stop_timer: asyncio.TimerHandle | None = None
        self._tasks = BackgroundTasks()
        self._has_order = False

    def receive(self, payload: bytes, retained: bool, mount_name: str) -> None:
        """Carry out or refuse an order; ``mount_name`` is the mount's name, or ``all``."""
        text = payload[: MAX_ORDER_LENGTH + 1].decode("utf-8", "replace").strip()
        if not text and retained:
            return
        word, _, arguments = text.partition(" ")
        if retained:
            self._refuse(text, "ignored because of its retain flag: publish orders without it")
        elif text == "stop":
            self._stop()
        elif len(text) > MAX_ORDER_LENGTH:
            once = CLIENT if len(payload) > MAX_MESSAGE_BYTES else None
            self._refuse(f"{text[:20]}…", f"no order is longer than {MAX_ORDER_LENGTH} characters", once)
        elif mount_name == ALL_GATEWAYS:
            self._refuse(text, "the only order for all mounts together is stop")
        elif word not in (*PLAIN_ORDERS, GOTO_ORDER) or (bool(arguments) is not (word == GOTO_ORDER)):
            self._refuse(text, f"there is no such order: {', '.join(('stop', *self._allowed_orders))}")
        elif word not in self._allowed_orders:
            self._refuse(text, f'the broker may not ask for this; orders = ["{word}"] under [mqtt] allows it')
        elif conflict := self._conflict_message():
            self._refuse(text, conflict)
        elif self._has_order:
            self._refuse(text, "the gateway is taking another order; send this one again in a moment")
        else:
            self._tasks.spawn(self._carry_out(text, word, arguments))

    def close(self) -> None:
        """Cancel the orders in progress; ``receive`` must not be called after that."""
        if self._stop_timer is not None:
            self._stop_timer.cancel()
        self._tasks.cancel()

    def _refuse(self, text: str, reason: str, once_key: str | None = None) -> None:
        self._gateway.wire_log.log_refusal(CLIENT, f"{text}: {reason}", once_key)

    def _stop(self) -> None:
        """Stop at once; after a stop less than ``STOP_PERIOD`` seconds ago, stop again when that time has passed."""
        left = self._last_stop_time + STOP_PERIOD - self._loop.time()
        if left <= 0:
            self._stop_now()
        elif self._stop_timer is None:
            self._stop_timer = self._loop.call_later(left, self._stop_now)

    def _stop_now(self) -> None:
        self._stop_timer, self._last_stop_time = None, self._loop.time()
        self._tasks.spawn(self._carry_out_stop())

    async def _carry_out_stop(self) -> None:
        answer = await self._gateway.carry_out(StopRequest())
        self._report(answer.outcome, f"stop: {answer.text}")

    async def _carry_out(self, text: str, order: str, arguments: str) -> None:
        self._has_order = True
        try:
            name = Named(arguments)
            request = GotoRequest(name, who=CLIENT) if order == GOTO_ORDER else PLAIN_ORDERS[order](who=CLIENT)
            answer = await self._gateway.carry_out(request)
        finally:
            self._has_order = False
        self._report(answer.outcome, f"{text}: {answer.text}")


#: The maximum number of other gateways with the same ID whose messages are answered.
MAX_OTHER_GATEWAYS = 100


class BrokerPresence:
    """The gateway's presence on the broker.

    Each gateway publishes its identity on ``PREFIX/ID/gateway``, and subscribes to that topic. A gateway that receives
    another's identity there publishes its own again, so that both know of the conflict. Orders could then be meant for
    either, so only stops are carried out. ``conflict_message``: a message about another gateway with this ID, or empty.
    """

    def __init__(self, topics: Topics, publish: Callable[[MqttMessage], None], warn: Callable[[str], None]) -> None:
        self._topics, self._publish, self._warn = topics, publish, warn
        self._instance = secrets.token_hex(8)
        about = {"instance": self._instance, "host": socket.gethostname(), "process": os.getpid(), "version": version()}
        self._presence_message = MqttMessage(topics.gateway, json.dumps(about).encode(), retain=True, is_state=True)
        self._online_message = MqttMessage(topics.availability, ONLINE, retain=True, is_state=True)
        self._answered_gateways: set[str] = set()
        self.conflict_message = ""

    @property
    def first_messages(self) -> list[MqttMessage]:
        """The first messages on every connection."""
        return [self._presence_message, self._online_message]

    @property
    def last_messages(self) -> list[MqttMessage]:
        """The last messages; the broker publishes them itself if the connection is lost."""
        return [MqttMessage(self._topics.availability, OFFLINE, retain=True)]

    def receive(self, received: ReceivedMessage) -> bool:
        """Handle a message from the broker; return whether it was about presence."""
        if received.topic == self._topics.availability:
            if received.payload == OFFLINE:  # of another gateway with this ID, or the will of a lost connection
                self.conflict_message = ""
                self._answered_gateways.clear()
                self._publish(self._online_message)
            return True
        if received.topic != self._topics.gateway:
            return False
        other, description = _parse_identity(received.payload)
        if other and other != self._instance and not received.retained:  # a retained message may be of an earlier run
            self._report_conflict(other, description)
        return True

    def _report_conflict(self, other_instance: str, other_description: str) -> None:
        self.conflict_message = (
            f"another gateway ({other_description}) has the ID {self._topics.id!r} on the broker, too: both obey only "
            f"stop until you change one of them (--mqtt-id)"
        )
        if other_instance not in self._answered_gateways and len(self._answered_gateways) < MAX_OTHER_GATEWAYS:
            self._answered_gateways.add(other_instance)
            self._publish(self._presence_message)
            self._warn(self.conflict_message)


def _parse_identity(payload: bytes) -> tuple[str, str]:
    """Return the sender's instance ID, and its host and process as text; both empty for an invalid message."""
    try:
        owner = json.loads(payload)
        return str(owner["instance"])[:64], printable(f"{owner['host']}, process {owner['process']}".encode())[:100]
    except (ValueError, TypeError, KeyError, RecursionError):
        return "", ""


#: Seconds between two checks of the mounts for changes.
CHECK_PERIOD = 1.0
HOME_ASSISTANT_OFF = "off"


class _PublishedMount:
    """One mount, and its last published state."""

    def __init__(self, service: MqttService, gateway: Gateway) -> None:
        self.gateway, self.name = gateway, gateway.config.name or DEFAULT_MOUNT_NAME
        self._service = service
        self._state: dict[str, Any] = {}
        self._identity: tuple[object, ...] = (None,)
        topic, allowed = service.topics.of(self.name, "event"), service.config.orders
        self.events = EventPublisher(lambda message: service.link.publish(MqttMessage(topic, message)), gateway.clock)
        self.orders = OrderRunner(gateway, allowed, lambda: service.presence.conflict_message, self._report_result)
        gateway.wire_log.sinks.append(self.events.put)

    def _report_result(self, kind: str, text: str) -> None:
        self.events.publish(kind, CLIENT, text)

    def update(self) -> None:
        """Queue the state if it has changed, and the Home Assistant description if the mount's identity has."""
        station, now = self._service, published_state(self.gateway)
        if now == self._state:
            return
        self._state = now
        message = msgspec.json.encode({**now, "time": round(self.gateway.clock(), 3)})
        station.link.put(MqttMessage(station.topics.of(self.name, "state"), message, retain=True, is_state=True))
        identity = (now["product"], now["model"], now["version"])
        prefix = station.config.home_assistant
        if prefix != HOME_ASSISTANT_OFF and identity != self._identity:
            self._identity = identity
            station.link.put(discovery_message(prefix, station.topics, self.name, now, station.config.orders))

    def close(self) -> None:
        """Stop publishing events and taking orders."""
        self.orders.close()
        self.gateway.wire_log.remove_sink(self.events.put)


class MqttService:
    """Publishes all mounts of this process on the broker. ``print_line`` and ``warn`` show messages at the terminal."""

    def __init__(
        self,
        config: MqttConfig,
        access: BrokerAccess,
        gateways: Sequence[Gateway],
        print_line: Callable[[str], None],
        warn: Callable[[str], None],
        connect: Connect | None = None,
    ) -> None:
        self.config, self._broker, self._print_line, self._warn = config, access.broker, print_line, warn
        self.topics = Topics(config.prefix, config.id or host_id())
        self.presence = BrokerPresence(self.topics, lambda message: self.link.publish(message), warn)
        topics = [self.topics.availability, self.topics.gateway, self.topics.of("+", "command"), self.topics.all_mounts]
        self.link = BrokerLink(
            access,
            topics,
            self._on_message,
            self._on_connection,
            self.presence.first_messages,
            self.presence.last_messages,
            connect,
        )
        self._mounts = {(mount := _PublishedMount(self, gateway)).name: mount for gateway in gateways}
        self._was_connected: bool | None = None
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin to connect and to publish."""
        self.link.start()
        self._task = asyncio.ensure_future(self._publish_changes())

    async def close(self) -> None:
        """Publish that this gateway ends, if the broker is connected, and disconnect."""
        if self._task is not None:
            self._task.cancel()
        for mount in self._mounts.values():
            mount.close()
        await self.link.close()

    async def _publish_changes(self) -> None:
        while True:
            for mount in list(self._mounts.values()):
                try:
                    mount.update()
                except Exception as error:  # a defect here must affect nothing but what is published of the mount
                    mount.gateway.wire_log.note_once("mqtt", f"internal error, please report it: {error!r}")
                await asyncio.sleep(0)  # programs are served between two mounts
            self.link.send()
            await asyncio.sleep(CHECK_PERIOD)

    def _on_message(self, received: ReceivedMessage) -> None:
        if self.presence.receive(received):
            return
        levels = [*self.topics.levels_of(received.topic), ""]
        if levels[0] == ALL_GATEWAYS:
            for mount in self._mounts.values():
                mount.orders.receive(received.payload, received.retained, ALL_GATEWAYS)
        elif (addressed := self._mounts.get(levels[1])) is not None:
            addressed.orders.receive(received.payload, received.retained, addressed.name)

    def _on_connection(self, connected: bool, reason: str) -> None:
        """Print or warn that the broker was connected or lost, if that is a change."""
        if connected and self._was_connected is None:
            self._print_line(f"ready broker {self._broker} as {self.topics.prefix}/{self.topics.id}")
        elif connected and not self._was_connected:
            self._warn(f"the broker {self._broker} is connected again")
        elif not connected and self._was_connected is not False:
            self._warn(
                f"the broker {self._broker} cannot be reached: {reason}. The mounts and their programs are not "
                "affected; the gateway keeps trying"
            )
        self._was_connected = connected
