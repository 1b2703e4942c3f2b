"""A gateway on a broker: what is shown of its mounts, what they may be told, and what is refused in words."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from gateway.app.config import MountConfig, SurfaceConfig
from gateway.app.config.tables import MqttConfig
from gateway.app.gateway import Gateway
from gateway.fleet import station as stations
from gateway.fleet.client import MAX_MESSAGE_BYTES
from gateway.fleet.station import MqttService
from tests.support.fake_broker import NOWHERE, PATIENCE, FakeBroker, until

pytestmark = pytest.mark.real_time
STATE, EVENT, COMMAND = (f"mount-gateway/pier/mount/{what}" for what in ("state", "event", "command"))


class There:
    """A gateway over a simulated mount, its station, and the broker."""

    def __init__(self, gateway: Gateway, config: MqttConfig) -> None:
        self.gateway, self.broker, self.said = gateway, FakeBroker(), list[str]()
        self.station = MqttService(config, NOWHERE, [gateway], self.said.append, self.said.append, self.broker.connect)

    @property
    def state(self) -> dict[str, Any]:
        """As it was told last."""
        told = self.broker.payloads(STATE)
        return dict(json.loads(told[-1])) if told else {}

    def happened(self, kind: str) -> list[str]:
        """The words of such events."""
        events = [json.loads(event) for event in self.broker.payloads(EVENT)]
        return [event["words"] for event in events if event["kind"] == kind]


@asynccontextmanager
async def shown(folder: Path, name: str | None = None, **keys: Any) -> AsyncIterator[There]:
    config = MountConfig(at="nexstar@sim", speed=6.0, sun=0.0, state=str(folder), name=name)
    gateway = Gateway(config, [SurfaceConfig(at="lx200@tcp://127.0.0.1:0")], warn=lambda text: None)
    await gateway.open()
    there = There(gateway, MqttConfig(at="mqtt://broker.invalid", **{"id": "pier", **keys}))
    try:
        assert await gateway.wait_identified(PATIENCE)
        there.station.start()
        await until(lambda: name is not None or (there.state.get("aligned") and there.state["altitude_degrees"]))
        yield there
    finally:
        await asyncio.gather(gateway.close(), there.station.close())


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stations, "CHECK_PERIOD", 0.05)


def play(work: Coroutine[Any, Any, None]) -> None:
    asyncio.run(work)


async def test_gateway_publishes_every_known_mount_value_to_the_broker(tmp_path: Path) -> None:
    async with shown(tmp_path) as there:
        told = there.state
        assert {"ra_hours", "dec_degrees", "altitude_degrees", "azimuth_degrees", "tracking", "moving", "aligned",
                "online", "model", "line", "programs", "time"} <= set(told)  # fmt: skip
        assert told["online"] is told["tracking"] is told["aligned"] is True and told["moving"] is False
        assert 0.0 <= told["ra_hours"] < 24.0 and told["model"] == "6-8se" and told["programs"] == 0
        assert all(message.retain for message in there.broker.published if message.topic == STATE)


def test_station_does_not_repeat_an_unchanged_mount(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def work() -> None:
        async with shown(tmp_path) as there:
            looks, now = 0, there.state

            def same(gateway: Gateway) -> dict[str, Any]:
                nonlocal looks
                looks += 1
                return {**now, "time": None}

            monkeypatch.setattr(stations, "published_state", same)
            await until(lambda: looks > 1)
            told = len(there.broker.payloads(STATE))
            await until(lambda: looks > 6)
            assert len(there.broker.payloads(STATE)) == told

    play(work())


async def test_named_mount_has_separate_topics(tmp_path: Path) -> None:
    async with shown(tmp_path, name="east", prefix="club/domes", id="two") as there:
        await until(lambda: there.broker.payloads("club/domes/two/east/state"))
        assert there.broker.wills[0] is not None and there.broker.wills[0].topic == "club/domes/two/availability"
        assert "club/domes/all/command" in there.broker.subscribed


@pytest.mark.parametrize("topic", [COMMAND, "mount-gateway/all/command"])
async def test_broker_stop_stops_the_mount(tmp_path: Path, topic: str) -> None:
    async with shown(tmp_path) as there:
        there.broker.say(COMMAND, b"park")
        await until(lambda: there.state["moving"])
        there.broker.say(topic, b"stop")
        await until(lambda: "stop: stopped" in there.happened("done"))
        await until(lambda: there.state["moving"] is False)
        assert there.happened("done")[0] == "park: it goes to its park position"


async def test_many_broker_stops_reach_the_line_few_times_including_the_last(tmp_path: Path) -> None:
    async with shown(tmp_path) as there:
        before = there.gateway.controller.stop_count
        there.broker.say("mount-gateway/all/command", b"stop", times=200)
        await until(lambda: len(there.happened("done")) == 2)
        assert there.gateway.controller.stop_count == before + 2


@pytest.mark.parametrize(
    ("topic", "payload", "retain", "why"),
    [
        (COMMAND, b"stop", True, "stop: ignored because of its retain flag"),
        (COMMAND, b"home", False, "home: the broker may not ask for this; orders"),
        (COMMAND, b"goto Vega", False, "goto Vega: the broker may not ask for this"),
        (COMMAND, b"goto", False, "goto: there is no such order: stop, park, wake"),
        (COMMAND, b"park now", False, "park now: there is no such order"),
        (COMMAND, b"dance", False, "dance: there is no such order"),
        (COMMAND, b"", False, ": there is no such order"),
        (COMMAND, b"\xff\x00", False, "there is no such order"),
        (COMMAND, b"x" * 5000, False, "no order is longer than 100 characters"),
        ("mount-gateway/all/command", b"park", False, "park: the only order for all mounts together is stop"),
    ],
)
async def test_disallowed_broker_order_is_refused_in_words(
    tmp_path: Path, topic: str, payload: bytes, retain: bool, why: str
) -> None:
    async with shown(tmp_path) as there:
        before = there.gateway.controller.stop_count
        there.broker.say(topic, payload, retain)
        await until(lambda: there.happened("refused"))
        assert why in there.happened("refused")[0] and len(there.happened("refused")[0]) < 200
        assert there.gateway.controller.stop_count == before and not there.happened("done")
        assert why in there.gateway.wire_log.recent_notices[-1].text


async def test_overlong_order_is_reported_once_and_a_stop_beside_it_arrives(tmp_path: Path) -> None:
    async with shown(tmp_path) as there:
        for _ in range(3):
            there.broker.say(COMMAND, b"x" * (MAX_MESSAGE_BYTES + 1))
            there.broker.say("mount-gateway/all/command", b"stop")
        await until(lambda: there.happened("done"))
        assert len(told := there.happened("refused")) == 1 and "100 characters" in told[0]


async def test_allowed_broker_order_is_still_checked_against_the_limits(tmp_path: Path) -> None:
    async with shown(tmp_path, orders=["goto"]) as there:
        there.broker.say(COMMAND, b"goto Acrux")  # never rises at the simulated site
        await until(lambda: there.happened("failed"))
        assert "below the horizon" in there.happened("failed")[0]
        there.broker.say(COMMAND, b"goto Vegaa")
        await until(lambda: len(there.happened("failed")) == 2)
        assert "there is no object 'Vegaa'" in there.happened("failed")[1]


async def test_two_gateways_with_one_id_report_it_and_obey_only_stops(tmp_path: Path) -> None:
    async with shown(tmp_path) as there:
        topic, broker = "mount-gateway/pier/gateway", there.broker
        [own] = broker.payloads(topic)
        other = json.dumps({"instance": "other", "host": "dome", "process": 7}).encode()
        broker.say(topic, own)
        broker.say(topic, other.replace(b"other", b"earlier"), retain=True)  # of an earlier run, as far as is known
        broker.say(topic, b"[] no JSON")
        broker.say(topic, other)
        broker.say(topic, other)
        await until(lambda: len(broker.payloads(topic)) == 2)
        broker.say(COMMAND, b"park")
        await until(lambda: there.happened("refused"))
        assert "another gateway (dome, process 7)" in there.happened("refused")[0]
        broker.say(COMMAND, b"stop")
        await until(lambda: "stop: stopped" in there.happened("done"))
        assert broker.payloads(topic) == [own, own], "the other one is answered once"
        assert [words for words in there.said if "another gateway" in words] == [
            there.station.presence.conflict_message
        ]

        broker.say("mount-gateway/pier/availability", b"offline")  # it has gone, and said so for both
        await until(lambda: broker.payloads("mount-gateway/pier/availability") == [b"online"] * 2)
        broker.say(COMMAND, b"park")
        await until(lambda: "park: it goes to its park position" in there.happened("done"))


async def test_unstable_broker_is_reported_once(tmp_path: Path) -> None:
    async with shown(tmp_path) as there:
        there.broker.down = OSError(111, "Connection refused")
        there.broker.lose()
        await until(lambda: len(there.broker.wills) > 3)
        there.broker.down = None
        await until(lambda: len(there.said) == 3)
        assert there.said[0] == "ready broker mqtt://broker.invalid:1883 as mount-gateway/pier"
        assert "are not affected" in there.said[1] and there.said[2].endswith("is connected again")


async def test_home_assistant_gets_the_entities_of_a_mount(tmp_path: Path) -> None:
    async with shown(tmp_path) as there:
        topic = "homeassistant/device/mount-gateway_pier_mount/config"
        await until(lambda: b"6-8se" in b"".join(there.broker.payloads(topic)))
        told = json.loads(there.broker.payloads(topic)[-1])
        assert told["state_topic"] == STATE and told["device"]["model"] == "6-8se"
        parts = told["components"]
        assert {"ra_hours", "online", "stop", "park", "wake"} <= set(parts) and "home" not in parts
        assert parts["stop"]["command_topic"] == COMMAND and parts["stop"]["payload_press"] == "stop"
        ids = [part["unique_id"] for part in parts.values()]
        assert len(set(ids)) == len(ids)
        for key, part in parts.items():
            assert part["platform"] == "button" or key in there.state


async def test_home_assistant_gets_nothing_where_discovery_is_off(tmp_path: Path) -> None:
    async with shown(tmp_path, home_assistant="off") as there:
        assert not [one.topic for one in there.broker.published if "config" in one.topic]
