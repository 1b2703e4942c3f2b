"""Mosquitto, the broker of Debian, on a free port; and somebody who listens on it and publishes there."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Any

from .processes import Process, Workshop, accepts, free_port, requires, wait_until


class Broker:
    """One that keeps nothing when it is ended. ``options`` are further lines of its configuration."""

    def __init__(self, workshop: Workshop, *options: str, port: int | None = None) -> None:
        requires("mosquitto")
        self.workshop, self.options, self.port = workshop, options, port or free_port()
        config = workshop.folder / f"mosquitto-{self.port}.conf"
        access = [] if any("password_file" in option for option in options) else ["allow_anonymous true"]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            access.append("user root")  # else it becomes another one, who may not look into the test's folder
        config.write_text("\n".join([f"listener {self.port} 127.0.0.1", *access, *options]) + "\n")
        self.config = config
        self.process = self._start()

    def _start(self) -> Process:
        process = self.workshop.start(["mosquitto", "-c", str(self.config)])
        wait_until("mosquitto listens", lambda: accepts(self.port))
        return process

    def end(self) -> None:
        """It is gone, and has forgotten everything."""
        self.process.end()

    def again(self) -> None:
        """Another one at the same port."""
        self.process = self._start()

    @property
    def url(self) -> str:
        """Where it is."""
        return f"mqtt://127.0.0.1:{self.port}"


class Onlooker:
    """Somebody on the broker. ``heard`` are (when, topic, payload, retained), in order."""

    def __init__(self, workshop: Workshop, broker: Broker, user: str = "", password: str = "") -> None:
        import paho.mqtt.client as mqtt
        from paho.mqtt.enums import CallbackAPIVersion

        self.heard: list[tuple[float, str, bytes, bool]] = []
        self._client = mqtt.Client(CallbackAPIVersion.VERSION2)
        if user:
            self._client.username_pw_set(user, password)
        self._client.reconnect_delay_set(1, 1)
        self._client.on_message = lambda client, data, message: self.heard.append(
            (time.monotonic(), message.topic, message.payload, message.retain)
        )
        self._client.on_connect = lambda client, *rest: client.subscribe("#", 1)
        self._client.connect("127.0.0.1", broker.port)
        self._client.loop_start()
        workshop.keep(self._leave)

    def _leave(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()

    def say(self, topic: str, payload: str | bytes, retain: bool = False) -> None:
        """Publish."""
        self._client.publish(topic, payload, 1, retain)

    def told(self, topic: str) -> list[bytes]:
        """What was published there."""
        return [payload for _, where, payload, _ in list(self.heard) if where == topic]

    def state(self, topic: str) -> dict[str, Any]:
        """The newest."""
        told = self.told(topic)
        return dict(json.loads(told[-1])) if told else {}

    def when(self, topic: str, payload: bytes) -> float:
        """When it was last heard, by the monotonic clock."""
        return max(at for at, where, said, _ in list(self.heard) if (where, said) == (topic, payload))


def folder(path: Path) -> dict[str, str]:
    """The environment of a gateway that keeps its state there."""
    path.mkdir(exist_ok=True)
    return {"STATE_DIRECTORY": str(path)}
