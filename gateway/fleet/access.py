"""What is needed to be let in by a broker: its address, the user, the password, the certificates.

The password comes from a file or from the environment. Whatever is missing is told before anything is opened.
"""

from __future__ import annotations

import os
import ssl
from importlib.util import find_spec
from pathlib import Path

from msgspec import Struct

from gateway.app.config.endpoints import Broker, parse_broker
from gateway.core.errors import UserError, about_file
from gateway.system.own_commands import how_to_add

PASSWORD = "MOUNT_GATEWAY_MQTT_PASSWORD"


class Access(Struct, frozen=True):
    """``user`` is None where the broker lets everybody in."""

    broker: Broker
    user: str | None = None
    password: str | None = None
    ca: str | None = None

    def tls(self) -> ssl.SSLContext | None:
        """The certificates that are trusted; None without TLS. Raises OSError."""
        return ssl.create_default_context(cafile=self.ca) if self.broker.tls else None


def access(at: str, user: str | None = None, password_file: str | None = None, ca: str | None = None) -> Access:
    """Raises UserError for what is missing or cannot be read."""
    if find_spec("aiomqtt") is None:
        raise UserError(f"for an MQTT broker aiomqtt is needed; to install it, {how_to_add('mqtt')}")
    broker = parse_broker(at)
    found = Access(broker, user or broker.user or None, _password(password_file), ca)
    if found.password is not None and found.user is None:
        raise UserError("there is a password for the broker and no user: write user under [mqtt]")
    try:
        found.tls()
    except OSError as error:  # an SSLError is one, too
        raise UserError(f"{ca}: {'no certificates' if isinstance(error, ssl.SSLError) else error.strerror}") from None
    return found


def _password(file: str | None) -> str | None:
    if file is None:
        return os.environ.get(PASSWORD) or None
    try:
        return Path(file).expanduser().read_text("utf-8").strip("\r\n")
    except OSError as error:
        raise UserError(f"{file}: {about_file(file, error)}") from None
    except UnicodeDecodeError:
        raise UserError(f"{file}: this is no UTF-8 text") from None
