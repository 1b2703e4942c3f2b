"""Publishes that this gateway is connected, and detects another gateway with the same ID.

Each gateway publishes on ``PREFIX/ID/gateway`` who it is, and subscribes to it. One that receives another's message
publishes its own once more, so that both know. Then it is not known which of them an order is meant for, and only stops
are carried out.
"""

from __future__ import annotations

import json
import os
import secrets
import socket
from collections.abc import Callable

from gateway.core.about import version
from gateway.core.wire_log import show
from gateway.fleet.topics import OFFLINE, ONLINE, Message, Received, Topics

#: The maximum number of other gateways that are answered.
MOST = 100


class Presence:
    """The gateway's presence on the broker. ``conflict``: a message about another gateway with this ID, or empty."""

    def __init__(self, topics: Topics, publish: Callable[[Message], None], warn: Callable[[str], None]) -> None:
        self._topics, self._publish, self._warn = topics, publish, warn
        self._instance = secrets.token_hex(8)
        about = {"instance": self._instance, "host": socket.gethostname(), "process": os.getpid(), "version": version()}
        self._who = Message(topics.gateway, json.dumps(about).encode(), retain=True, newest=True)
        self._here = Message(topics.availability, ONLINE, retain=True, newest=True)
        self._answered: set[str] = set()
        self.conflict = ""

    @property
    def first_messages(self) -> list[Message]:
        """The first messages on every connection."""
        return [self._who, self._here]

    @property
    def last_messages(self) -> list[Message]:
        """The last messages; the broker publishes them itself if the connection is lost."""
        return [Message(self._topics.availability, OFFLINE, retain=True)]

    def receive(self, received: Received) -> bool:
        """Take a message of the broker; return whether it was about presence."""
        if received.topic == self._topics.availability:
            if received.payload == OFFLINE:  # of another gateway with this ID, or the will of a lost connection
                self.conflict = ""
                self._answered.clear()
                self._publish(self._here)
            return True
        if received.topic != self._topics.gateway:
            return False
        other, words = _about(received.payload)
        if other and other != self._instance and not received.retained:  # a retained message may be of an earlier run
            self._report_conflict(other, words)
        return True

    def _report_conflict(self, other: str, words: str) -> None:
        self.conflict = (
            f"another gateway ({words}) has the ID {self._topics.id!r} on the broker, too: only stop is obeyed until "
            "one of them has another one (--mqtt-id)"
        )
        if other not in self._answered and len(self._answered) < MOST:
            self._answered.add(other)
            self._publish(self._who)
            self._warn(self.conflict)


def _about(payload: bytes) -> tuple[str, str]:
    """Return the instance of a gateway, and host and process in words; both empty for an invalid message."""
    try:
        told = json.loads(payload)
        return str(told["instance"])[:64], show(f"{told['host']}, process {told['process']}".encode())[:100]
    except (ValueError, TypeError, KeyError, RecursionError):
        return "", ""
