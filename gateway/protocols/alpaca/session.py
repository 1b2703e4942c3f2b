"""What belongs to one client of an Alpaca surface: whether it is connected, its target, the height that it has set."""

from __future__ import annotations

from gateway.protocols.base.session import Kept, Session


class AlpacaKept(Kept):
    """``ra``, ``dec`` are the target, degrees; ``elevation`` is in metres. None: not set yet."""

    connected: bool = False
    ra: float | None = None
    dec: float | None = None
    elevation: float | None = None


class AlpacaSession(Session):
    """One client: a program on one computer that counts as one by its ClientID."""

    inherits = False  # another one of the same computer is another program
    state = AlpacaKept
    kept: AlpacaKept
