"""The MQTT client of one connection, held within bounds: what a broker sends may be small, or the connection is cut.

aiomqtt has no limit of its own for what comes in, and leaves a connection open that did not answer. Both is mended here
and nowhere else, for it needs paho's client, which lies within.
"""

from __future__ import annotations

import contextlib
import logging
import secrets
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from typing import Any, Protocol

from gateway.fleet.access import Access
from gateway.fleet.topics import Message

#: Seconds after which a broker that said nothing is asked, and that an answer may take.
KEEPALIVE, ANSWER = 10, 5.0
#: Bytes of one packet, and messages that wait to be looked at.
LARGEST, WAITING = 65536, 2000


class Client(Protocol):
    """What of aiomqtt's client is used here."""

    @property
    def messages(self) -> Any: ...
    async def subscribe(self, topic: list[tuple[str, int]], /) -> Any: ...
    async def publish(self, topic: str, /, payload: bytes, qos: int, retain: bool) -> None: ...


class Flooded(Exception):
    """The broker sends more than anybody has a use for."""


def too_much(size: int) -> Flooded:
    """A message is too long."""
    return Flooded(f"it sent a message of {size} bytes, and {LARGEST} are the most")


#: Makes a connection, with the message that the broker publishes when it is lost.
Connect = Callable[[Message | None], AbstractAsyncContextManager[Client]]


def connecting(access: Access) -> Connect:
    """Connections to a broker. They raise Flooded, an OSError, a ValueError or aiomqtt's MqttError."""

    @asynccontextmanager
    async def connect(will: Message | None) -> AsyncIterator[Client]:
        import aiomqtt

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
            clean_session=True,  # what was ordered while nobody listened is not carried out later
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
                yield client
        except Exception:
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
