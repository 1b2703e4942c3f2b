"""The address of an MQTT broker: ``mqtt://HOST:PORT``, or ``mqtts://`` with TLS.

A user's name may stand before the host. A password may not: a flag is seen by everybody on the computer.
"""

from __future__ import annotations

from urllib.parse import urlsplit

from msgspec import Struct

from gateway.core.errors import UserError

#: The ports of brokers, by scheme.
PORTS = {"mqtt": 1883, "mqtts": 8883}
RIGHT = "write mqtt://HOST:PORT, or mqtts://HOST:PORT with TLS"


class Broker(Struct, frozen=True):
    """Where a broker is. ``user`` is empty where the address names none."""

    host: str
    port: int
    tls: bool
    user: str = ""

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"mqtt{'s' * self.tls}://{host}:{self.port}"


def parse_broker(text: str) -> Broker:
    """Raises UserError that says what would be right, and repeats no password."""
    try:
        parts = urlsplit(text)
        host, port, password = parts.hostname, parts.port, parts.password
    except ValueError:
        raise UserError(f"this is no address of a broker: {RIGHT}") from None
    if password is not None:
        raise UserError(
            "the address holds a password, which others could see: put it into a file and name that with "
            "password-file, or into the environment variable MOUNT_GATEWAY_MQTT_PASSWORD"
        )
    if parts.scheme not in PORTS or not host or parts.path.strip("/") or parts.query or parts.fragment:
        raise UserError(f"{text!r}: {RIGHT}")
    return Broker(host, port or PORTS[parts.scheme], parts.scheme == "mqtts", parts.username or "")
