"""The MQTT client of one connection: what is needed to be let in, and bounds that hold the broker.

The password comes from a file or from the environment. Whatever is missing is told before anything is opened. What a
broker sends may be small, or the connection is cut: aiomqtt has no limit of its own for what comes in, and leaves a
connection open that did not answer. Both is mended here and nowhere else, for it needs paho's client, which lies
within. MQTT 5 is spoken, by which a broker passes on whether a message was published with the retain flag; one that
knows only 3.1.1 tells that of stored messages alone.
"""

from __future__ import annotations

import contextlib
import logging
import os
import secrets
import socket
import ssl
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol

from msgspec import Struct

from gateway.app.config.endpoints import Broker, parse_broker
from gateway.core.errors import UserError, about_file
from gateway.fleet.topics import Message
from gateway.system.own_commands import how_to_add

PASSWORD = "MOUNT_GATEWAY_MQTT_PASSWORD"
#: Seconds after which a broker that said nothing is asked, and that an answer may take.
KEEPALIVE, ANSWER = 10, 5.0
#: How the topics end by which mounts are given orders.
ORDERS = "/command"
#: How a broker refuses MQTT 5 because it is older: in its own words, and in those of 3.1.1.
OLD = (1, 132)
#: Bytes of one packet, and messages that wait to be looked at.
LARGEST, WAITING = 65536, 2000


class Access(Struct, frozen=True):
    """``user`` is None where the broker lets everybody in."""

    broker: Broker
    user: str | None = None
    password: str | None = None
    ca: str | None = None

    def tls(self) -> ssl.SSLContext | None:
        """The certificates that are trusted; None without TLS. Raises OSError."""
        return ssl.create_default_context(cafile=self.ca) if self.broker.tls else None


def access(at: str, user: str | None = None, password_file: str | None = None, ca: str | None = None) -> Access:
    """Raises UserError for what is missing or cannot be read."""
    if find_spec("aiomqtt") is None:
        raise UserError(f"for an MQTT broker aiomqtt is needed; to install it, {how_to_add('mqtt')}")
    broker = parse_broker(at)
    found = Access(broker, user or broker.user or None, _password(password_file), ca)
    if found.password is not None and found.user is None:
        raise UserError("there is a password for the broker and no user: write user under [mqtt]")
    try:
        found.tls()
    except OSError as error:  # an SSLError is one, too
        raise UserError(f"{ca}: {'no certificates' if isinstance(error, ssl.SSLError) else error.strerror}") from None
    return found


def _password(file: str | None) -> str | None:
    if file is None:
        return os.environ.get(PASSWORD) or None
    try:
        return Path(file).expanduser().read_text("utf-8").strip("\r\n")
    except OSError as error:
        raise UserError(f"{file}: {about_file(file, error)}") from None
    except UnicodeDecodeError:
        raise UserError(f"{file}: this is no UTF-8 text") from None


class Client(Protocol):
    """What of aiomqtt's client is used here."""

    @property
    def messages(self) -> Any: ...
    async def subscribe(self, topics: Sequence[str], /) -> None: ...
    async def publish(self, topic: str, /, payload: bytes, qos: int, retain: bool) -> None: ...


class _Subscriber:
    """Of aiomqtt's client, what is used. Of orders it is told whether they were published with the retain flag."""

    def __init__(self, client: Any, v5: bool) -> None:
        self._client, self._v5 = client, v5
        self.publish = client.publish

    @property
    def messages(self) -> Any:
        return self._client.messages

    async def subscribe(self, topics: Sequence[str], /) -> None:
        from paho.mqtt.subscribeoptions import SubscribeOptions

        def how(topic: str) -> Any:
            return SubscribeOptions(qos=1, retainAsPublished=topic.endswith(ORDERS)) if self._v5 else 1

        await self._client.subscribe([(topic, how(topic)) for topic in topics])


class Flooded(Exception):
    """The broker sends more than anybody has a use for."""


def too_much(size: int) -> Flooded:
    """A message is too long."""
    return Flooded(f"it sent a message of {size} bytes, and {LARGEST} are the most")


#: Makes a connection, with the message that the broker publishes when it is lost.
Connect = Callable[[Message | None], AbstractAsyncContextManager[Client]]


def connecting(access: Access) -> Connect:
    """Connections to a broker. They raise Flooded, an OSError, a ValueError or aiomqtt's MqttError."""

    old = False

    @asynccontextmanager
    async def connect(will: Message | None) -> AsyncIterator[Client]:
        import aiomqtt

        nonlocal old
        quiet = logging.getLogger("gateway.mqtt")
        quiet.setLevel(logging.CRITICAL)  # what matters is told in words, by whoever uses the connection
        broker = access.broker
        client = aiomqtt.Client(
            broker.host,
            broker.port,
            username=access.user,
            password=access.password,
            identifier=f"mg-{secrets.token_hex(8)}",
            will=None if will is None else aiomqtt.Will(will.topic, will.payload, 1, will.retain),
            protocol=aiomqtt.ProtocolVersion.V311 if old else aiomqtt.ProtocolVersion.V5,
            # What was ordered while nobody listened is not carried out later; in MQTT 5 no session outlives its end.
            clean_session=True if old else None,
            timeout=ANSWER,
            keepalive=KEEPALIVE,
            max_queued_incoming_messages=WAITING,
            tls_context=access.tls(),
            logger=quiet,
            socket_options=[(socket.SOL_SOCKET, socket.SO_RCVBUF, LARGEST)],
        )
        paho: Any = client._client
        too_long: list[int] = []
        _limit(paho, too_long)
        try:
            async with client:
                yield _Subscriber(client, not old)
        except Exception as error:
            reason = getattr(error, "rc", None)
            old = old or getattr(reason, "value", reason) in OLD
            if too_long:
                raise too_much(too_long[0]) from None
            raise
        finally:
            _cut(paho)

    return connect


def _limit(paho: Any, too_long: list[int]) -> None:
    """Cut the connection when a packet says that it is too long: after a few megabytes, however many it has."""
    read = paho.loop_read

    def loop_read(*arguments: Any) -> Any:
        outcome = read(*arguments)
        packet = paho._in_packet
        if packet["have_remaining"] and packet["remaining_length"] > LARGEST:
            too_long.append(packet["remaining_length"])
            _cut(paho)
        return outcome

    paho.loop_read = loop_read


def _cut(paho: Any) -> None:
    """End a connection that may still be open: paho then hears of it and takes it down."""
    open_one: socket.socket | None = paho.socket()
    if open_one is not None:
        with contextlib.suppress(OSError):
            open_one.shutdown(socket.SHUT_RDWR)
