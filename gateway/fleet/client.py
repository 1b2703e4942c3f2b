"""Connects to an MQTT broker: credentials, TLS, and limits on what the broker may send.

The password comes from a file or from the environment; missing settings are reported before anything is opened. Two
defects of aiomqtt are worked around here, through the paho client inside it: it does not limit the size of received
messages (of one that is too large, only the beginning is kept), and it does not close a connection on which the broker
has not answered. A broker with MQTT 5 passes on whether a message was published with the retain flag; one with MQTT
3.1.1 sets the flag on stored messages alone.
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
from gateway.core.errors import UserError, explain_file_error
from gateway.fleet.topics import MqttMessage
from gateway.system.own_commands import install_instruction

PASSWORD_VARIABLE = "MOUNT_GATEWAY_MQTT_PASSWORD"
#: Seconds of silence after which the broker is pinged, and the timeout for an answer.
KEEPALIVE_PERIOD, ANSWER_TIMEOUT = 10, 5.0
#: The end of the topics on which mounts get orders.
COMMAND_SUFFIX = "/command"
#: The reason codes with which an older broker refuses MQTT 5: that of MQTT 3.1.1, and that of MQTT 5.
OLD_BROKER_CODES = (1, 132)
#: The maximum size of a message in bytes, and of the queue of received messages.
MAX_MESSAGE_BYTES, MAX_WAITING_MESSAGES = 65536, 2000
#: How many bytes of a packet are stored: even after the longest topic they show whether the payload is too long.
MAX_PACKET_BYTES = 3 * MAX_MESSAGE_BYTES


class BrokerAccess(Struct, frozen=True):
    """The broker and the credentials for it. ``user`` is None if the broker needs none."""

    broker: Broker
    user: str | None = None
    password: str | None = None
    ca_file: str | None = None  # file of trusted certificates

    def tls_context(self) -> ssl.SSLContext | None:
        """Return the TLS settings with the trusted certificates; None without TLS. Raises OSError."""
        return ssl.create_default_context(cafile=self.ca_file) if self.broker.tls else None


def get_access(
    url: str, user: str | None = None, password_file: str | None = None, ca: str | None = None
) -> BrokerAccess:
    """Collect the settings for a broker. Raises UserError for a missing package or setting, or an unreadable file."""
    if find_spec("aiomqtt") is None:
        raise UserError(f"for an MQTT broker aiomqtt is needed; to install it, {install_instruction('mqtt')}")
    broker = parse_broker(url)
    broker_access = BrokerAccess(broker, user or broker.user or None, _read_password(password_file), ca)
    if broker_access.password is not None and broker_access.user is None:
        raise UserError("there is a password for the broker and no user: write user under [mqtt]")
    try:
        broker_access.tls_context()
    except OSError as error:  # SSLError is an OSError, too
        raise UserError(f"{ca}: {'no certificates' if isinstance(error, ssl.SSLError) else error.strerror}") from None
    return broker_access


def _read_password(file: str | None) -> str | None:
    if file is None:
        return os.environ.get(PASSWORD_VARIABLE) or None
    try:
        return Path(file).expanduser().read_text("utf-8").strip("\r\n")
    except OSError as error:
        raise UserError(f"{file}: {explain_file_error(file, error, reading=True)}") from None
    except UnicodeDecodeError:
        raise UserError(f"{file}: this is not UTF-8 text") from None


class MqttClient(Protocol):
    """The part of aiomqtt's client that is used here."""

    @property
    def messages(self) -> Any: ...
    async def subscribe(self, topics: Sequence[str], /) -> None: ...
    async def publish(self, topic: str, /, payload: bytes, qos: int, retain: bool) -> None: ...


class _RetainAwareClient:
    """Wraps aiomqtt's client. With MQTT 5 it asks the broker to pass on the retain flag that an order was sent with."""

    def __init__(self, client: Any, uses_mqtt_5: bool) -> None:
        self._client, self._uses_mqtt_5 = client, uses_mqtt_5
        self.publish = client.publish

    @property
    def messages(self) -> Any:
        return self._client.messages

    async def subscribe(self, topics: Sequence[str], /) -> None:
        from paho.mqtt.subscribeoptions import SubscribeOptions

        def options_for(topic: str) -> Any:
            return SubscribeOptions(qos=1, retainAsPublished=topic.endswith(COMMAND_SUFFIX)) if self._uses_mqtt_5 else 1

        await self._client.subscribe([(topic, options_for(topic)) for topic in topics])


class FloodError(Exception):
    """The broker sends too many messages."""


#: Makes a connection, with the message that the broker publishes if the connection is lost (the will).
Connect = Callable[[MqttMessage | None], AbstractAsyncContextManager[MqttClient]]


def make_connector(access: BrokerAccess) -> Connect:
    """Return a function that connects to a broker. It raises OSError, ValueError or aiomqtt's MqttError."""

    lacks_mqtt_5 = False

    @asynccontextmanager
    async def connect(last_will: MqttMessage | None) -> AsyncIterator[MqttClient]:
        import aiomqtt

        nonlocal lacks_mqtt_5
        quiet = logging.getLogger("gateway.mqtt")
        quiet.setLevel(logging.CRITICAL)  # the caller reports what matters to the user
        broker = access.broker
        client = aiomqtt.Client(
            broker.host,
            broker.port,
            username=access.user,
            password=access.password,
            identifier=f"mg-{secrets.token_hex(8)}",
            will=None if last_will is None else aiomqtt.Will(last_will.topic, last_will.payload, 1, last_will.retain),
            protocol=aiomqtt.ProtocolVersion.V311 if lacks_mqtt_5 else aiomqtt.ProtocolVersion.V5,
            # Orders sent while the gateway was not connected are not carried out later; MQTT 5 keeps no session anyway.
            clean_session=True if lacks_mqtt_5 else None,
            timeout=ANSWER_TIMEOUT,
            keepalive=KEEPALIVE_PERIOD,
            max_queued_incoming_messages=MAX_WAITING_MESSAGES,
            tls_context=access.tls_context(),
            logger=quiet,
            socket_options=[(socket.SOL_SOCKET, socket.SO_RCVBUF, MAX_MESSAGE_BYTES)],
        )
        paho: Any = client._client
        _limit_packet_size(paho)
        try:
            async with client:
                yield _RetainAwareClient(client, not lacks_mqtt_5)
        except Exception as error:
            reason = getattr(error, "rc", None)
            lacks_mqtt_5 = lacks_mqtt_5 or getattr(reason, "value", reason) in OLD_BROKER_CODES
            raise
        finally:
            _shut_down_socket(paho)

    return connect


def _limit_packet_size(paho: Any) -> None:
    """Let paho store only the beginning of a packet that is too long. It is acknowledged, and passed on cut off."""
    read = paho.loop_read

    def loop_read(*arguments: Any) -> Any:
        outcome = read(*arguments)
        del paho._in_packet["packet"][MAX_PACKET_BYTES:]
        return outcome

    paho.loop_read = loop_read


def _shut_down_socket(paho: Any) -> None:
    """Shut down the connection's socket if it is still open; paho then closes the connection."""
    open_one: socket.socket | None = paho.socket()
    if open_one is not None:
        with contextlib.suppress(OSError):
            open_one.shutdown(socket.SHUT_RDWR)
