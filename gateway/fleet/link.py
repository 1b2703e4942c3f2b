"""The connection to a broker, on a separate thread: it is always restored, and a mount never waits for it.

Messages are taken from the outbox in groups of a few. The next group is sent when the broker has acknowledged the last
message and the events of the group before. Other states need no acknowledgement, because a broker takes messages in
order; after a reconnect all states are sent again. A slow broker gets only the newest states. From a broker that sends
too many messages, the gateway disconnects for a while.
"""

from __future__ import annotations

import asyncio
import contextlib
import random
import re
import threading
from collections.abc import Callable, Coroutine, Sequence
from concurrent.futures import Executor
from typing import Any, TypeVar, TypeVarTuple

from gateway.fleet.client import MAX_MESSAGE_BYTES, BrokerAccess, Connect, FloodError, MqttClient, make_connector
from gateway.fleet.topics import MqttMessage, Outbox, ReceivedMessage

_T = TypeVar("_T")
_Arguments = TypeVarTuple("_Arguments")

#: Seconds before the first, second and later attempts to reconnect.
RETRY_DELAYS = (0.25, 0.5, 1.0)
#: How many failed attempts are repeated soon; the pause in seconds after more of them, after a refusal or a flood.
MAX_QUICK_RETRIES, LONG_PAUSE = 300, 5.0
#: Maximum number of messages that are sent before an acknowledgement, and that a broker may send in a second.
MAX_IN_FLIGHT, MAX_MESSAGE_RATE = 50, 500
#: Timeout in seconds for the last messages at the end.
CLOSE_TIMEOUT = 1.0


class _SingleThreadLoop(asyncio.SelectorEventLoop):
    """An event loop on a thread of its own: it may block, so it runs blocking calls itself, without more threads."""

    def run_in_executor(
        self, executor: Executor | None, func: Callable[[*_Arguments], _T], *args: *_Arguments
    ) -> asyncio.Future[_T]:
        """Run the function at once, on this thread."""
        outcome: asyncio.Future[_T] = self.create_future()
        try:
            outcome.set_result(func(*args))
        except Exception as error:
            outcome.set_exception(error)
        return outcome


class BrokerLink:
    """Keeps the connection to a broker. ``first_messages`` are sent on every connection, ``last_messages`` at the end.

    The first of the last messages is also the last will. ``on_message`` and ``on_connection`` (whether the broker is
    connected now, and why not) are called on the loop on which the link was started.
    """

    def __init__(
        self,
        access: BrokerAccess,
        subscriptions: Sequence[str],
        on_message: Callable[[ReceivedMessage], None],
        on_connection: Callable[[bool, str], None],
        first_messages: Sequence[MqttMessage] = (),
        last_messages: Sequence[MqttMessage] = (),
        connect: Connect | None = None,
        max_rate: int = MAX_MESSAGE_RATE,
    ) -> None:
        self._connect = connect or make_connector(access)
        self._subscriptions = list(subscriptions)
        self._on_message, self._on_connection, self._max_message_rate = on_message, on_connection, max_rate
        self._first_messages, self._last_messages = first_messages, last_messages
        self._outbox = Outbox()
        self._caller_loop: asyncio.AbstractEventLoop | None = None
        self._loop: _SingleThreadLoop | None = None
        self._wake_event = asyncio.Event()
        self._end_requested = asyncio.Event()
        self._thread_ended = threading.Event()

    def start(self) -> None:
        """Begin to connect."""
        self._caller_loop, self._loop = asyncio.get_running_loop(), _SingleThreadLoop()
        threading.Thread(target=self._run_thread, name="mqtt", daemon=True).start()

    def put(self, message: MqttMessage) -> None:
        """Queue a message; it is sent after the next ``send`` at the latest."""
        self._outbox.put(message)

    def send(self) -> None:
        """Send the queued messages as soon as the broker takes them; the thread is woken only once for all of them."""
        if self._outbox.has_messages:
            self._call_on_thread(self._wake_event.set)

    def publish(self, message: MqttMessage) -> None:
        """Queue a message and send it as soon as the broker takes it."""
        self.put(message)
        self.send()

    async def close(self) -> None:
        """Send the last messages, if the broker takes them within `CLOSE_TIMEOUT` seconds, and disconnect."""
        if self._loop is None:
            return
        self._call_on_thread(self._end_requested.set)
        until = asyncio.get_running_loop().time() + CLOSE_TIMEOUT
        while not self._thread_ended.is_set() and asyncio.get_running_loop().time() < until:
            await asyncio.sleep(0.01)

    def _call_on_thread(self, function: Callable[[], object]) -> None:
        with contextlib.suppress(RuntimeError):  # the thread has ended
            if self._loop is not None:
                self._loop.call_soon_threadsafe(function)

    def _call_on_caller(self, function: Callable[..., object], *arguments: object) -> None:
        with contextlib.suppress(RuntimeError):  # the gateway has ended
            if self._caller_loop is not None:
                self._caller_loop.call_soon_threadsafe(function, *arguments)

    # --- on the thread ----------------------------------------------------------------------------------------------

    def _run_thread(self) -> None:
        assert self._loop is not None
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._keep_connected())
        finally:
            self._loop.close()
            self._thread_ended.set()

    async def _keep_connected(self) -> None:
        failures = 0
        while not self._end_requested.is_set():
            pause = RETRY_DELAYS[min(failures, len(RETRY_DELAYS) - 1)] if failures < MAX_QUICK_RETRIES else LONG_PAUSE
            failures += 1
            try:
                async with self._connect(self._last_messages[0] if self._last_messages else None) as client:
                    failures = 0
                    await self._use_connection(client)
            except Exception as error:  # of three libraries; try again after any of them
                if isinstance(error, FloodError) or type(error).__name__ == "MqttConnectError":  # the broker refuses
                    pause = LONG_PAUSE
                if not self._end_requested.is_set():
                    self._call_on_caller(self._on_connection, False, _failure_reason(error))
            await self._pause(pause * random.uniform(0.8, 1.2))

    async def _pause(self, seconds: float) -> None:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await self._end_requested.wait()

    async def _use_connection(self, client: MqttClient) -> None:
        """Use a connection until it is lost or the link is closed."""
        if self._subscriptions:
            await client.subscribe(self._subscriptions)
        for message in self._first_messages:
            await _send(client, message)
        self._outbox.requeue_states()
        self._call_on_caller(self._on_connection, True, "")
        await _run_until_first_ends(self._read(client), self._write(client), self._end_requested.wait())
        if self._end_requested.is_set():
            for message in (*self._outbox.take(MAX_IN_FLIGHT), *self._last_messages):
                await _send(client, message)

    async def _read(self, client: MqttClient) -> None:
        loop = asyncio.get_running_loop()
        since, count = loop.time(), 0
        async for message in client.messages:
            if loop.time() - since >= 1.0:
                since, count = loop.time(), 0
            count += 1
            if count > self._max_message_rate:
                raise FloodError(f"it sent more than {self._max_message_rate} messages in a second")
            payload = message.payload[: MAX_MESSAGE_BYTES + 1] if isinstance(message.payload, bytes) else b""
            self._call_on_caller(self._on_message, ReceivedMessage(str(message.topic), payload, bool(message.retain)))

    async def _write(self, client: MqttClient) -> None:
        while True:
            messages = self._outbox.take(MAX_IN_FLIGHT)
            if not messages:
                await self._wake_event.wait()
                self._wake_event.clear()
                continue
            for message in messages[:-1]:
                await _send(client, message, int(not message.is_state))
            await _send(client, messages[-1])


async def _send(client: MqttClient, message: MqttMessage, qos: int = 1) -> None:
    await client.publish(message.topic, payload=message.payload, qos=qos, retain=message.retain)


async def _run_until_first_ends(*coroutines: Coroutine[Any, Any, object]) -> None:
    """Run coroutines until the first of them ends, and cancel the others. Raises what the first raises."""
    tasks = [asyncio.ensure_future(work) for work in coroutines]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def _failure_reason(error: Exception) -> str:
    """Return a short reason why the connection failed."""
    if isinstance(error, TimeoutError):
        return "it does not answer"
    reason = re.sub(r"^\[Errno -?\d+\] ", "", str(error)).strip() or type(error).__name__
    if "[code:134]" in reason or "[code:135]" in reason or "uthori" in reason:
        return "it refuses the user or the password: look at user and password-file, or MOUNT_GATEWAY_MQTT_PASSWORD"
    if reason.startswith("Disconnected"):
        return "the connection to it broke"
    return reason
