"""Topics and messages on the broker, and the outbox of messages that wait to be published.

``PREFIX/ID/availability`` and ``PREFIX/ID/gateway`` are about a gateway; ``PREFIX/ID/MOUNT/state``, ``event`` and
``command`` are about a mount of it. ``PREFIX/all/command`` is for every mount on the broker.
"""

from __future__ import annotations

import re
import socket
import threading
from collections import deque

from msgspec import Struct

from gateway.app.config.checks import ALL_GATEWAYS
from gateway.app.config.keys import NAME_PATTERN

#: The name of a mount without a name.
DEFAULT_MOUNT_NAME = "mount"
ONLINE, OFFLINE = b"online", b"offline"
#: The maximum number of events stored while the broker is not connected; then the oldest are dropped.
MAX_QUEUED_EVENTS = 200


class MqttMessage(Struct, frozen=True):
    """A message to publish: an event, or a state. At every reconnect the newest state of each topic is sent again."""

    topic: str
    payload: bytes
    retain: bool = False
    is_state: bool = False  # replaces the earlier state of its topic


class ReceivedMessage(Struct, frozen=True):
    """A message from the broker. If ``retained``, it has the retain flag, and may be old."""

    topic: str
    payload: bytes
    retained: bool


class Topics(Struct, frozen=True):
    """The topics of a gateway; ``id`` may be ``+``, the wildcard for all gateways."""

    prefix: str
    id: str  # of the gateway

    @property
    def availability(self) -> str:
        return f"{self.prefix}/{self.id}/availability"

    @property
    def gateway(self) -> str:
        """The topic on which the process that has this ID publishes its identity."""
        return f"{self.prefix}/{self.id}/gateway"

    @property
    def all_mounts(self) -> str:
        """The topic of orders for all mounts on the broker."""
        return f"{self.prefix}/{ALL_GATEWAYS}/command"

    def of(self, mount: str, kind: str) -> str:
        """Return the topic of a mount for a ``kind`` of message: ``state``, ``event`` or ``command``."""
        return f"{self.prefix}/{self.id}/{mount}/{kind}"

    def levels_of(self, topic: str) -> list[str]:
        """Return the levels of a topic after the prefix; an empty list for a topic without the prefix."""
        return topic[len(self.prefix) + 1 :].split("/") if topic.startswith(f"{self.prefix}/") else []


def host_id() -> str:
    """Return the default ID of a gateway: the computer's name, reduced to characters that a topic may contain."""
    name = "-".join(re.findall(NAME_PATTERN, socket.gethostname())) or "gateway"
    return f"{name}-computer" if name == ALL_GATEWAYS else name


class Outbox:
    """The messages that wait to be published: the newest state of each topic, and the last events.

    Its size is bounded, however long the broker is not connected. One thread puts messages in, another takes them out.
    ``take`` returns states first, because they are current.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._newest_by_topic: dict[str, MqttMessage] = {}
        self._waiting_topics: dict[str, None] = {}
        self._events: deque[MqttMessage] = deque(maxlen=MAX_QUEUED_EVENTS)

    def put(self, message: MqttMessage) -> None:
        """Add a message; a state replaces the previous state of its topic."""
        with self._lock:
            if message.is_state:
                self._newest_by_topic[message.topic] = message
                self._waiting_topics[message.topic] = None
            else:
                self._events.append(message)

    @property
    def has_messages(self) -> bool:
        """Whether any message waits."""
        return bool(self._waiting_topics or self._events)

    def take(self, max_count: int) -> list[MqttMessage]:
        """Remove and return the next messages, at most ``max_count``."""
        with self._lock:
            topics = list(self._waiting_topics)[:max_count]
            for topic in topics:
                del self._waiting_topics[topic]
            messages = [self._newest_by_topic[topic] for topic in topics]
            while self._events and len(messages) < max_count:
                messages.append(self._events.popleft())
            return messages

    def requeue_states(self) -> None:
        """Queue all states again: after a reconnect the broker may have forgotten them."""
        with self._lock:
            self._waiting_topics = dict.fromkeys(self._newest_by_topic)
