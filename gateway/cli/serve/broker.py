"""The MQTT broker of a gateway that serves: its flags, and the connection, which nothing waits for.

Without ``[mqtt]`` and ``--mqtt`` nothing of it is loaded.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from gateway.app.config.describing import keys
from gateway.app.config.tables import MqttConfig

if TYPE_CHECKING:
    from gateway.app.config import Config, Source
    from gateway.app.gateway import Gateway
    from gateway.cli.serve.live import Screen
    from gateway.fleet.access import Access
    from gateway.fleet.station import Station

#: Flag -> the key that it stands for; what else there is to say stands in the file.
FLAGS = {"mqtt": "at", "mqtt-id": "id"}


def add_mqtt(parser: Any) -> None:
    """The flags."""
    group = parser.add_argument_group("an MQTT broker on which the mounts are shown, and from which they are stopped")
    known = {key.name: key for key in keys("mqtt")}
    for flag, name in FLAGS.items():
        group.add_argument(f"--{flag}", metavar=known[name].shown, help=known[name].help)


def put_mqtt(arguments: argparse.Namespace, tables: dict[str, object], source: Source) -> None:
    """What the flags say of the broker."""
    for flag, name in FLAGS.items():
        value = getattr(arguments, flag.replace("-", "_"))
        there = tables.get("mqtt") or [{}]
        if value is not None and isinstance(there, list) and isinstance(there[0], dict):
            tables["mqtt"] = [{**there[0], name: value}]
            source.flags[("mqtt", 0, name)] = f"--{flag}"


def let_in(config: Config) -> Access | None:
    """What the broker asks for; None where there is to be none. Raises UserError for what is missing."""
    if not config.mqtt:
        return None
    from gateway.fleet.access import access

    mqtt = config.mqtt[0]
    return access(mqtt.at, mqtt.user, mqtt.password_file, mqtt.ca)


def open_broker(config: Config, access: Access | None, gateways: Sequence[Gateway], screen: Screen) -> Station | None:
    """Show the mounts on the broker, as soon as it is there and for as long as the gateway runs."""
    if access is None:
        return None
    from gateway.fleet.station import Station

    mqtt: MqttConfig = config.mqtt[0]
    station = Station(mqtt, access, gateways, screen.say, screen.warn)
    station.start()
    return station
