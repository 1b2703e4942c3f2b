"""A mount as Home Assistant takes up a new device: what can be read off it, and the buttons that it has.

One retained message a mount (Home Assistant 2024.11 and later).
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping
from typing import Any

from gateway.core.about import VERSION
from gateway.fleet.topics import Message, Topics

#: Key of the state -> name, unit, decimals that are shown.
NUMBERS = {
    "ra_hours": ("Right ascension", "h", 4),
    "dec_degrees": ("Declination", "°", 3),
    "altitude_degrees": ("Altitude", "°", 2),
    "azimuth_degrees": ("Azimuth", "°", 2),
    "programs": ("Programs", None, 0),
}
#: Key of the state -> name, class.
FLAGS = {
    "online": ("Mount answers", "connectivity"),
    "moving": ("Moving", "moving"),
    "tracking": ("Tracking", None),
    "aligned": ("Aligned", None),
}
#: Order -> name, icon.
BUTTONS = {"stop": ("Stop", "mdi:stop-circle"), "park": ("Park", "mdi:parking"), "wake": ("Wake", "mdi:weather-night"),
           "home": ("Home", "mdi:home")}  # fmt: skip


def discovery(
    prefix: str, topics: Topics, mount: str, state: Mapping[str, Any], orders: Collection[str]
) -> Message:  # fmt: skip
    """The message that tells of a mount; ``orders`` are those that the broker may give."""
    device = re.sub(r"[^A-Za-z0-9_-]", "_", f"{topics.prefix}_{topics.id}_{mount}")
    told: dict[str, Any] = {
        "device": {
            "identifiers": [device],
            "name": mount if mount != "mount" else f"Mount of {topics.id}",
            "manufacturer": state["product"],
            "model": state["model"],
            "sw_version": state["version"],
        },
        "origin": {"name": "mount-gateway", "sw_version": VERSION},
        "availability_topic": topics.availability,
        "state_topic": topics.of(mount, "state"),
        "components": {
            key: {**part, "unique_id": f"{device}_{key}"}
            for key, part in (*_readings(), *_buttons(topics.of(mount, "command"), orders))
        },
    }
    told["device"] = {key: value for key, value in told["device"].items() if value is not None}
    return Message(f"{prefix}/device/{device}/config", json.dumps(told).encode(), retain=True, newest=True)


def _readings() -> list[tuple[str, dict[str, Any]]]:
    found: list[tuple[str, dict[str, Any]]] = [
        ("does", {"platform": "sensor", "name": "Does", "value_template": "{{ value_json.does }}"})
    ]
    for key, (name, unit, decimals) in NUMBERS.items():
        number = {"platform": "sensor", "name": name, "value_template": f"{{{{ value_json.{key} }}}}",
                  "suggested_display_precision": decimals, "unit_of_measurement": unit}  # fmt: skip
        found.append((key, {word: value for word, value in number.items() if value is not None}))
    for key, (name, kind) in FLAGS.items():
        flag = {"platform": "binary_sensor", "name": name, "device_class": kind,
                "value_template": f"{{{{ 'ON' if value_json.{key} else 'OFF' }}}}"}  # fmt: skip
        found.append((key, {word: value for word, value in flag.items() if value is not None}))
    return found


def _buttons(topic: str, orders: Collection[str]) -> list[tuple[str, dict[str, Any]]]:
    return [
        (order, {"platform": "button", "name": name, "icon": icon, "command_topic": topic, "payload_press": order})
        for order, (name, icon) in BUTTONS.items()
        if order == "stop" or order in orders
    ]
