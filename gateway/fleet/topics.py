"""The topics on the broker: what they are called, and which mount one is about.

``PREFIX/ID/availability`` and ``PREFIX/ID/gateway`` are about a gateway, ``PREFIX/ID/MOUNT/state``, ``event`` and
``command`` about a mount of it. ``PREFIX/all/command`` is for every mount on the broker.
"""

from __future__ import annotations

import re
import socket

from msgspec import Struct

from gateway.app.config.checks import EVERY
from gateway.app.config.keys import WORD

#: What a mount without a name is called.
UNNAMED = "mount"
ONLINE, OFFLINE = b"online", b"offline"


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
