"""What happens on a mount, as events: of which kind, and never more than a broker can use."""

from __future__ import annotations

import json
from typing import Any

from gateway.core.wire_log import WireLog
from gateway.fleet.mount_messages import EVENT_BURST, EVENT_RATE, MAX_TEXT_LENGTH, EventPublisher
from tests.support.each import each


class There:
    def __init__(self) -> None:
        self.now, self.told = 1000.0, list[dict[str, Any]]()
        self.log = WireLog(lambda: self.now)
        self.events = EventPublisher(lambda told: self.told.append(json.loads(told)), lambda: self.now)
        self.log.sinks.append(self.events.put)


@each(
    ("side", "arrow", "kind"),
    [
        ("127.0.0.1:5", "+", "connected"),
        ("127.0.0.1:5", "-", "disconnected"),
        ("127.0.0.1:5", "!", "refused"),
        ("mount", "!", "note"),
        ("mount", "^", "port opened"),
        ("mount", "v", "port lost"),
    ],
)
def test_mount_event_has_a_kind(side: str, arrow: str, kind: str) -> None:
    there = There()
    there.log.put(side, arrow, note="words")
    assert there.told == [{"time": "1970-01-01T00:16:40.000Z", "kind": kind, "who": side, "words": "words"}]


def test_conversation_rows_are_not_published_as_mount_events() -> None:
    there = There()
    for arrow in ("<", ">", "raw", "r", "x"):
        there.log.put("mount", arrow, b"abc")
    assert not there.told


def test_surplus_mount_events_are_counted() -> None:
    there = There()
    for _ in range(int(EVENT_BURST) + 40):
        there.log.put("127.0.0.1:5", "+")
    assert len(there.told) == EVENT_BURST
    there.now += 3.0 / EVENT_RATE
    there.log.put("127.0.0.1:5", "-")
    assert [event["kind"] for event in there.told[-2:]] == ["left out", "disconnected"]
    assert there.told[-2]["words"].startswith("40 events")


def test_mount_event_texts_are_shortened_and_client_names_escaped() -> None:
    there = There()
    there.events.publish("refused", "a\x1bb", "x" * 5000)
    assert there.told[0]["who"] == "a\\x1bb" and len(there.told[0]["words"]) == MAX_TEXT_LENGTH
