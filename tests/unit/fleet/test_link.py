"""The connection to a broker: what is lost is told again, what is too much is dropped, and nobody waits for it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager
from typing import Any

import pytest

from gateway.fleet import link as links
from gateway.fleet.client import MAX_MESSAGE_BYTES
from gateway.fleet.link import BrokerLink
from gateway.fleet.topics import MAX_QUEUED_EVENTS, MqttMessage, Outbox, ReceivedMessage
from tests.support.each import each
from tests.support.fake_broker import NOWHERE, FakeBroker, until

pytestmark = pytest.mark.real_time
HERE, GONE = (
    MqttMessage("a/availability", b"online", retain=True),
    MqttMessage("a/availability", b"offline", retain=True),
)


@pytest.fixture(autouse=True)
def _impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(links, "RETRY_DELAYS", (0.01,))
    monkeypatch.setattr(links, "LONG_PAUSE", 0.02)


class There:
    """A link, its broker, and what it has told."""

    def __init__(self, flood: int = links.MAX_MESSAGE_RATE) -> None:
        self.broker, self.heard, self.told = FakeBroker(), list[ReceivedMessage](), list[tuple[bool, str]]()
        self.link = BrokerLink(
            NOWHERE, ["a/command"], self.heard.append, lambda there, why: self.told.append((there, why)), [HERE],
            [GONE], self.broker.connect, flood,
        )  # fmt: skip


@asynccontextmanager
async def linked(flood: int = links.MAX_MESSAGE_RATE) -> AsyncIterator[There]:
    there = There(flood)
    there.link.start()
    try:
        await until(lambda: there.told)
        yield there
    finally:
        await there.link.close()


def play(work: Coroutine[Any, Any, None]) -> None:
    asyncio.run(work)


def state(payload: bytes) -> MqttMessage:
    return MqttMessage("a/state", payload, retain=True, is_state=True)


async def test_broker_link_announces_the_gateway_and_its_departure() -> None:
    async with linked() as there:
        assert there.broker.wills == [GONE] and there.told == [(True, "")]
        assert there.broker.subscribed == ["a/command"]
    assert there.broker.payloads("a/availability") == [b"online", b"offline"]


async def test_broker_message_is_handled_on_the_gateways_event_loop() -> None:
    async with linked() as there:
        there.broker.say("a/command", b"stop", True)
        await until(lambda: there.heard)
        assert there.heard == [ReceivedMessage("a/command", b"stop", True)]


async def test_broker_link_publishes_the_newest_state_after_a_loss() -> None:
    async with linked() as there:
        there.link.publish(state(b"1"))
        await until(lambda: there.broker.payloads("a/state") == [b"1"])
        there.broker.down = OSError(111, "Connection refused")
        there.broker.lose()
        await until(lambda: len(there.told) > 2)
        assert there.told[1:3] == [(False, "the connection is lost"), (False, "Connection refused")]
        there.link.publish(state(b"2"))
        there.link.publish(state(b"3"))
        there.broker.down = None
        await until(lambda: there.told[-1][0])
        await until(lambda: there.broker.payloads("a/state") == [b"1", b"3"])
        assert there.broker.payloads("a/availability") == [b"online", b"online"]


async def test_broker_link_publishes_again_a_state_that_the_broker_forgot() -> None:
    async with linked() as there:
        there.link.publish(state(b"1"))
        await until(lambda: there.broker.payloads("a/state") == [b"1"])
        there.broker.lose()
        await until(lambda: there.broker.payloads("a/state") == [b"1", b"1"])


async def test_broker_that_acknowledges_nothing_gets_the_newest_state_later() -> None:
    async with linked() as there:
        there.broker.mute = True
        for number in range(1000):
            there.link.publish(state(b"%d" % number))
            there.link.publish(MqttMessage("a/event", b"%d" % number))
        await asyncio.sleep(0)
        there.broker.mute = False
        await until(lambda: there.broker.payloads("a/event")[-1:] == [b"999"])
        assert there.broker.payloads("a/state")[-1] == b"999" and len(there.broker.payloads("a/state")) < 20
        assert len(there.broker.payloads("a/event")) <= MAX_QUEUED_EVENTS + links.MAX_IN_FLIGHT


async def test_flooding_broker_is_disconnected_for_a_while() -> None:
    async with linked(flood=5) as there:
        there.broker.say("a/command", b"stop", times=50)
        await until(lambda: (False, "it sent more than 5 messages in a second")
                    in there.told)  # fmt: skip
        assert len(there.heard) == 5
        await until(lambda: there.told[-1] == (True, ""))


async def test_overlong_broker_message_is_truncated_and_a_stop_beside_it_arrives() -> None:
    async with linked() as there:
        there.broker.say("a/command", b"x" * (2 * MAX_MESSAGE_BYTES))
        there.broker.say("a/command", b"stop")
        await until(lambda: len(there.heard) == 2)
        assert [message.payload for message in there.heard] == [b"x" * (MAX_MESSAGE_BYTES + 1), b"stop"]
        assert there.told == [(True, "")], "the link stays, and a stop is not lost"


async def test_shutdown_does_not_wait_for_a_silent_broker(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(links, "CLOSE_TIMEOUT", 0.05)
    async with linked() as there:
        there.broker.mute = True
        async with asyncio.timeout(60.0):
            await there.link.close()
        there.broker.mute = False


@each(
    ("error", "why"),
    [
        (OSError(111, "Connection refused"), "Connection refused"),
        (OSError("[Errno 111] Connection refused"), "Connection refused"),
        (OSError("[Errno -2] Name or service not known"), "Name or service not known"),
        (
            ValueError("[code:135] Not authorized"),
            "it refuses the user or the password: look at user and password-file, or MOUNT_GATEWAY_MQTT_PASSWORD",
        ),
        (ValueError("Disconnected during message iteration"), "the connection to it broke"),
        (TimeoutError(), "it does not answer"),
        (RuntimeError(), "RuntimeError"),
    ],
)
def test_lost_broker_is_reported_with_its_reason(error: Exception, why: str) -> None:
    assert links._failure_reason(error) == why


def test_broker_outbox_is_bounded() -> None:
    outbox = Outbox()
    for number in range(MAX_QUEUED_EVENTS * 3):
        outbox.put(MqttMessage("a/event", b"%d" % number))
        outbox.put(state(b"%d" % number))
    assert [message.payload for message in outbox.take(3)] == [b"599", b"400", b"401"]
    assert len(outbox.take(10_000)) == MAX_QUEUED_EVENTS - 2 and not outbox.take(1)
    outbox.requeue_states()
    assert [message.payload for message in outbox.take(3)] == [b"599"]
