"""That this gateway is there, and whether another one has the same ID.

Each tells on ``PREFIX/ID/gateway`` who it is, and listens there: whoever hears another one answers it once, so that
both know. Which of them an order was meant for is not known then, and only stops are obeyed.
"""

from __future__ import annotations

import json
import os
import secrets
import socket
from collections.abc import Callable

from gateway.core.about import VERSION
from gateway.core.wire_log import show
from gateway.fleet.topics import OFFLINE, ONLINE, Heard, Message, Topics

#: Others that are remembered as answered.
MOST = 100


class Presence:
    """``clash`` says who else has this ID; empty where nobody has."""

    def __init__(self, topics: Topics, publish: Callable[[Message], None], warn: Callable[[str], None]) -> None:
        self._topics, self._publish, self._warn = topics, publish, warn
        self._instance = secrets.token_hex(8)
        about = {"instance": self._instance, "host": socket.gethostname(), "process": os.getpid(), "version": VERSION}
        self._who = Message(topics.gateway, json.dumps(about).encode(), retain=True, newest=True)
        self._here = Message(topics.availability, ONLINE, retain=True, newest=True)
        self._answered: set[str] = set()
        self.clash = ""

    @property
    def greeting(self) -> list[Message]:
        """What is said first on every connection."""
        return [self._who, self._here]

    @property
    def parting(self) -> list[Message]:
        """What is said last, or by the broker when this gateway is lost."""
        return [Message(self._topics.availability, OFFLINE, retain=True)]

    def hear(self, heard: Heard) -> bool:
        """-> whether this was about the ID."""
        if heard.topic == self._topics.availability:
            if heard.payload == OFFLINE:  # another one of this ID has gone, or this one was lost and is back
                self.clash = ""
                self._answered.clear()
                self._publish(self._here)
            return True
        if heard.topic != self._topics.gateway:
            return False
        other, words = _about(heard.payload)
        if other and other != self._instance and not heard.retained:  # what is retained may be of an earlier run
            self._meet(other, words)
        return True

    def _meet(self, other: str, words: str) -> None:
        self.clash = (
            f"another gateway ({words}) has the ID {self._topics.id!r} on the broker, too: only stop is obeyed until "
            "one of them has another one (--mqtt-id)"
        )
        if other not in self._answered and len(self._answered) < MOST:
            self._answered.add(other)
            self._publish(self._who)
            self._warn(self.clash)


def _about(payload: bytes) -> tuple[str, str]:
    """Which instance a gateway is, and where."""
    try:
        told = json.loads(payload)
        return str(told["instance"])[:64], show(f"{told['host']}, process {told['process']}".encode())[:100]
    except (ValueError, TypeError, KeyError, RecursionError):
        return "", ""
