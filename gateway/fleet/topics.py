"""What goes over the broker: the topics, and which mount one is about; messages, and those that wait to be published.

``PREFIX/ID/availability`` and ``PREFIX/ID/gateway`` are about a gateway, ``PREFIX/ID/MOUNT/state``, ``event`` and
``command`` about a mount of it. ``PREFIX/all/command`` is for every mount on the broker.
"""

from __future__ import annotations

import re
import socket
import threading
from collections import deque

from msgspec import Struct

from gateway.app.config.checks import EVERY
from gateway.app.config.keys import WORD

#: What a mount without a name is called.
UNNAMED = "mount"
ONLINE, OFFLINE = b"online", b"offline"
#: Events that are kept for a broker that is away; the oldest are dropped.
EVENTS = 200


class Message(Struct, frozen=True):
    """What is published. ``newest``: only the newest of its topic matters, and it is published again after a loss."""

    topic: str
    payload: bytes
    retain: bool = False
    newest: bool = False


class Heard(Struct, frozen=True):
    """What came from the broker. ``retained``: it lay there already, and was not sent just now."""

    topic: str
    payload: bytes
    retained: bool


class Topics(Struct, frozen=True):
    """Those of one gateway; ``id`` may be ``+`` for all gateways."""

    prefix: str
    id: str

    @property
    def availability(self) -> str:
        return f"{self.prefix}/{self.id}/availability"

    @property
    def gateway(self) -> str:
        """Which process has this ID."""
        return f"{self.prefix}/{self.id}/gateway"

    @property
    def everyone(self) -> str:
        """Commands for all mounts on the broker."""
        return f"{self.prefix}/{EVERY}/command"

    def of(self, mount: str, what: str) -> str:
        """``state``, ``event`` or ``command`` of a mount."""
        return f"{self.prefix}/{self.id}/{mount}/{what}"

    def parts(self, topic: str) -> list[str]:
        """What follows the prefix; nothing for a topic of somebody else's."""
        return topic[len(self.prefix) + 1 :].split("/") if topic.startswith(f"{self.prefix}/") else []


def own_id() -> str:
    """The name of this computer, as a topic can hold it."""
    name = "-".join(re.findall(WORD, socket.gethostname())) or "gateway"
    return f"{name}-computer" if name == EVERY else name


class Outbox:
    """What waits to be published: of every state the newest, of what has happened the last so many.

    It never grows, however long the broker is away. One thread puts in, another takes out. ``take`` gives states first:
    they say how it is now.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._newest: dict[str, Message] = {}
        self._waiting: dict[str, None] = {}
        self._events: deque[Message] = deque(maxlen=EVENTS)

    def put(self, message: Message) -> None:
        """One more; a state takes the place of the one before it."""
        with self._lock:
            if message.newest:
                self._newest[message.topic] = message
                self._waiting[message.topic] = None
            else:
                self._events.append(message)

    @property
    def any(self) -> bool:
        """Whether anything waits."""
        return bool(self._waiting or self._events)

    def take(self, most: int) -> list[Message]:
        """The next ones; they do not wait any more."""
        with self._lock:
            topics = list(self._waiting)[:most]
            for topic in topics:
                del self._waiting[topic]
            found = [self._newest[topic] for topic in topics]
            while self._events and len(found) < most:
                found.append(self._events.popleft())
            return found

    def again(self) -> None:
        """The broker may have forgotten everything: all states wait once more."""
        with self._lock:
            self._waiting = dict.fromkeys(self._newest)
