"""The identity of a device, which stays the same as long as the mount is at the same place on the same computer."""

from __future__ import annotations

import socket
import uuid

_SPACE = uuid.UUID("6f3d2c1e-7c1b-5d0e-9a53-6d6f756e7467")


def unique_id(title: str) -> str:
    """Of the mount that is called so on this computer."""
    return str(uuid.uuid5(_SPACE, f"{socket.gethostname()} {title}"))
