"""The messages about a mount: its state, its events, and its description for Home Assistant.

The state is made from cached readings, without asking the mount. Angles are rounded, so that a mount at rest is
published once and not every second. Events are taken from the wire log. A program that reconnects for every command
must not flood the broker: more than a few events per second are only counted, and their number is published. For Home
Assistant (2024.11 and later) a mount is a device with readings and buttons, described in one retained message.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from datetime import UTC, datetime
from typing import Any

from gateway.app.gateway import Gateway
from gateway.app.status import activity
from gateway.core import operations as op
from gateway.core.about import version
from gateway.core.wire_log import MOUNT_SIDE, Entry, printable
from gateway.fleet.topics import MqttMessage, Topics

#: ``Entry.arrow`` of the wire log -> kind of the published event. Other entries are not published.
EVENT_KINDS = {"+": "connected", "-": "disconnected", "^": "port opened", "v": "port lost", "!": "refused"}
#: Maximum number of events in a burst, and per second after it; maximum length of an event's text in characters.
EVENT_BURST, EVENT_RATE, MAX_TEXT_LENGTH = 20.0, 5.0, 500
#: Key of the state -> name, unit, decimals that are shown.
NUMBER_SENSORS = {
    "ra_hours": ("Right ascension", "h", 4),
    "dec_degrees": ("Declination", "°", 3),
    "altitude_degrees": ("Altitude", "°", 2),
    "azimuth_degrees": ("Azimuth", "°", 2),
    "programs": ("Programs", None, 0),
}
#: Key of the state -> name, device class of Home Assistant.
BINARY_SENSORS = {
    "online": ("Mount answers", "connectivity"),
    "moving": ("Moving", "moving"),
    "tracking": ("Tracking", None),
    "aligned": ("Aligned", None),
}
#: Order -> name and icon of its button.
BUTTONS = {"stop": ("Stop", "mdi:stop-circle"), "park": ("Park", "mdi:parking"), "wake": ("Wake", "mdi:weather-night"),
           "home": ("Home", "mdi:home")}  # fmt: skip


def published_state(gateway: Gateway) -> dict[str, Any]:
    """Return the state of a mount as it is published; a value that is not known is None."""
    now = gateway.state()
    look, identity, horizontal = now.look, now.identity, now.horizontal
    status, position = look.status, look.position
    return {
        "online": look.online,
        "does": activity(look) or look.state,
        "ra_hours": None if position is None else round(position.ra / 15.0, 5),
        "dec_degrees": None if position is None else round(position.dec, 4),
        "altitude_degrees": None if horizontal is None else round(horizontal.alt, 2),
        "azimuth_degrees": None if horizontal is None else round(horizontal.az, 2),
        "tracking": None if status is None else status.tracking is not op.Tracking.OFF,
        "moving": look.moves,
        "goto_ended_short": now.wanted.goto_failure or None,
        "aligned": None if status is None else status.aligned,
        "asleep": look.asleep,
        "held": look.held,
        "product": identity.product if identity else None,
        "model": identity.model if identity else None,
        "version": identity.version if identity else None,
        "line": {"state": look.state, "reason": look.reason, "answer_seconds": round(now.reply_time, 2)},
        "programs": look.programs,
    }


class EventPublisher:
    """Publishes events as JSON by ``publish_json``, at a limited rate. ``put`` is a sink of the wire log."""

    def __init__(self, publish_json: Callable[[bytes], None], clock: Callable[[], float]) -> None:
        self._publish_json, self._clock = publish_json, clock
        self._events_left, self._refilled_at, self._dropped_count = EVENT_BURST, clock(), 0

    def put(self, entry: Entry) -> None:
        """Publish an entry of the wire log, if `EVENT_KINDS` lists it."""
        kind = EVENT_KINDS.get(entry.arrow)
        if kind is None:
            return
        if entry.arrow == "!" and entry.side == MOUNT_SIDE:
            kind = "note"
        self.publish(kind, entry.side, entry.note)

    def publish(self, kind: str, source: str, text: str) -> None:
        """Publish an event, unless there are too many; ``source`` is a program, the mount, or ``mqtt``."""
        now = self._clock()
        self._events_left = min(EVENT_BURST, self._events_left + max(0.0, now - self._refilled_at) * EVENT_RATE)
        self._refilled_at = now
        if self._events_left < 1.0:
            self._dropped_count += 1
            return
        self._events_left -= 1.0
        if self._dropped_count:
            self._send(now, "left out", MOUNT_SIDE, f"{self._dropped_count} events, because there were too many")
            self._dropped_count = 0
        self._send(now, kind, source, text)

    def _send(self, now: float, kind: str, source: str, text: str) -> None:
        time = datetime.fromtimestamp(now, UTC).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z"
        event = {"time": time, "kind": kind, "who": printable(source.encode()), "words": text[:MAX_TEXT_LENGTH]}
        self._publish_json(json.dumps(event).encode())


def discovery_message(
    prefix: str, topics: Topics, mount: str, state: Mapping[str, Any], orders: Collection[str]
) -> MqttMessage:  # fmt: skip
    """Return the message, under Home Assistant's ``prefix``, that describes a mount; ``orders``: those allowed."""
    device = re.sub(r"[^A-Za-z0-9_-]", "_", f"{topics.prefix}_{topics.id}_{mount}")
    description: dict[str, Any] = {
        "device": _without_none(
            identifiers=[device],
            name=mount if mount != "mount" else f"Mount of {topics.id}",
            manufacturer=state["product"],
            model=state["model"],
            sw_version=state["version"],
        ),
        "origin": {"name": "mount-gateway", "sw_version": version()},
        "availability_topic": topics.availability,
        "state_topic": topics.of(mount, "state"),
        "components": {
            key: {**part, "unique_id": f"{device}_{key}"}
            for key, part in (*_sensor_components(), *_button_components(topics.of(mount, "command"), orders))
        },
    }
    return MqttMessage(f"{prefix}/device/{device}/config", json.dumps(description).encode(), retain=True, is_state=True)


def _without_none(**values: Any) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}


def _sensor_components() -> Iterator[tuple[str, dict[str, Any]]]:
    yield "does", {"platform": "sensor", "name": "Does", "value_template": "{{ value_json.does }}"}
    for key, (name, unit, decimals) in NUMBER_SENSORS.items():
        yield key, _without_none(
            platform="sensor", name=name, value_template=f"{{{{ value_json.{key} }}}}",
            suggested_display_precision=decimals, unit_of_measurement=unit,
        )  # fmt: skip
    for key, (name, kind) in BINARY_SENSORS.items():
        value = f"{{{{ 'ON' if value_json.{key} else 'OFF' }}}}"
        yield key, _without_none(platform="binary_sensor", name=name, device_class=kind, value_template=value)


def _button_components(topic: str, orders: Collection[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    for order, (name, icon) in BUTTONS.items():
        if order == "stop" or order in orders:
            button = {"platform": "button", "name": name, "icon": icon, "command_topic": topic, "payload_press": order}
            yield order, button
