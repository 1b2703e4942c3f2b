"""What the operator has decided for a mount."""

from __future__ import annotations

from msgspec import Struct

from gateway.mount.safety.limits import Limits


class Policy(Struct, frozen=True):
    """``own_park``: the park position is his own choice. ``unaligned``: whether a mount that is not aligned may be sent
    to axis readings (``allow`` or ``refuse``). ``silence`` and ``silence_closed`` are for how many seconds a client
    that moves the mount by hand may be silent, on an open connection and after it was closed.
    """

    limits: Limits = Limits()
    site_time: str = "unaligned"
    equinox: str = "jnow"
    own_park: bool = False
    unaligned: str = "refuse"
    silence: float = 30.0
    silence_closed: float = 5.0
