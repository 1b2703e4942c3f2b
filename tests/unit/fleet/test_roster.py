"""What is known of all mounts on a broker, and what is left out because it has another form."""

from __future__ import annotations

import json

import pytest

from gateway.fleet.overview import server as rosters
from gateway.fleet.overview.server import MountList
from gateway.fleet.topics import ReceivedMessage
from tests.support.each import each

NOW = 1_000_000.0


def roster(*heard: tuple[str, object], retained: bool = False) -> MountList:
    made = MountList("club", lambda: NOW)
    for topic, value in heard:
        payload = value if isinstance(value, bytes) else json.dumps(value).encode()
        made.receive(ReceivedMessage(f"club/{topic}", payload, retained))
    return made


def test_roster_shows_a_mount_with_its_state_and_whether_its_gateway_is_online() -> None:
    made = roster(
        ("west/east/state", {"online": True, "does": "slewing", "moving": True, "ra_hours": 1.5, "more": [1]}),
        ("pier/mount/state", {"online": False, "does": "down"}),
        ("west/availability", b"online"),
    )
    pier, west = made.mounts()
    assert (pier["gateway"], pier["available"], pier["online"]) == ("pier", False, False)
    assert (west["gateway"], west["mount"], west["available"], west["moving"]) == ("west", "east", True, True)
    assert west["ra"] == 1.5 and west["alt"] is None and west["age"] == 0
    made.receive(ReceivedMessage("club/west/availability", b"offline", False))
    assert made.mounts()[1]["available"] is False


def test_roster_shows_the_age_of_a_retained_state() -> None:
    [mount] = roster(("a/b/state", {"time": NOW - 75.2}), retained=True).mounts()
    assert mount["age"] == 75


def test_roster_drops_a_deleted_state() -> None:
    assert not roster(("a/b/state", {}), ("a/b/state", b"")).mounts()


def test_roster_shows_outcomes_of_orders_and_no_other_events() -> None:
    made = roster(
        ("a/b/state", {}),
        ("a/b/event", {"kind": "done", "who": "mqtt", "words": "stop: stopped"}),
        ("a/b/event", {"kind": "connected", "who": "127.0.0.1:3", "words": ""}),
        ("a/b/event", {"kind": "refused", "who": "127.0.0.1:3", "words": "no"}),
    )
    assert made.mounts()[0]["said"] == "stop: stopped"
    end = {"kind": "done", "who": "mqtt", "words": "stop: stopped"}
    assert not roster(("a/b/state", {}), ("a/b/event", end), retained=True).mounts()[0]["said"]


@each("payload", [b"[]", b"{", b"\xff", b'{"online": 3}', b'{"ra_hours": "x"}', b"[" * 60000])
def test_fleet_roster_ignores_malformed_messages(payload: bytes) -> None:
    assert not roster(("a/b/state", payload)).mounts()


@each("topic", ["a/state", "a/b/c/state", "a/b/command", "", "/", "a/gateway"])
def test_roster_ignores_other_topics(topic: str) -> None:
    assert not roster((topic, {})).mounts()
    made = MountList("club", lambda: NOW)
    made.receive(ReceivedMessage("clubhouse/a/b/state", b"{}", False))
    assert not made.mounts()


def test_fleet_roster_size_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rosters, "MAX_MOUNTS", 3)
    states = [(f"a/{number}/state", {}) for number in range(9)]
    made = roster(*states, *((f"{name}/availability", b"online") for name in "xyzw"))
    assert len(made.mounts()) == 3 and len(made._is_online) == 3
