"""The keys of ``[mqtt]``: the broker on which the mounts of this gateway are shown, and from which they are stopped.

The password stands neither here nor in a flag, where other users and backups see it: it is in a file of its own, or in
the environment.
"""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct, field

from gateway.app.config.declaring import WORD, Plain, Word, key

#: What topics may begin with: words with slashes between.
PARTS = rf"^{WORD}(/{WORD})*$"
_Parts = Annotated[str, Meta(pattern=PARTS, title="words of letters, digits and _ . -, with / between")]


class MqttConfig(Struct, frozen=True, forbid_unknown_fields=True, rename="kebab"):
    """``[mqtt]``."""

    at: Annotated[
        str,
        key(
            "the MQTT broker on which the mounts are shown: mqtt://HOST:PORT, or mqtts://HOST:PORT with TLS",
            "URL",
            "mqtts://broker.example.org:8883",
        ),
    ]
    id: Annotated[
        Word | None, key("what this gateway is called on the broker (default: the name of the computer)", "ID", "pier")
    ] = None
    prefix: Annotated[_Parts, key("what all topics begin with", "PREFIX")] = "mount-gateway"
    user: Annotated[Plain | None, key("the user that the broker knows", "USER", "observatory")] = None
    password_file: Annotated[
        str | None,
        key(
            "a file that holds the password and nothing else (default: the environment variable "
            "MOUNT_GATEWAY_MQTT_PASSWORD, where it is set)",
            "FILE",
            "/etc/mount-gateway/mqtt-password",
        ),
    ] = None
    ca: Annotated[
        str | None,
        key(
            "mqtts: a file with the certificates that the broker's is signed by (default: those of the system)",
            "FILE",
            "/etc/mount-gateway/ca.pem",
        ),
    ] = None
    home_assistant: Annotated[
        _Parts, key("the prefix at which Home Assistant looks for new devices; off: it is told of none", "PREFIX")
    ] = "homeassistant"
    orders: Annotated[
        list[Literal["park", "wake", "home", "goto"]],
        key("what the broker may ask of a mount besides stop, which it always may", "ORDERS"),
    ] = field(default_factory=lambda: ["park", "wake"])  # fmt: skip
