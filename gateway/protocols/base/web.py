"""What a protocol adds to a web server, where its programs speak HTTP: made of lines that its framing cuts.

Bytes of such a protocol are lines of text, whichever port carries them; what turns HTTP into them and back belongs to
the protocol, what listens and who may come in to everybody.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from msgspec import Struct

from gateway.transport.handler import Arrive, Listener


class WebDevice(Struct, frozen=True):
    """One mount that is offered: how its programs come in, what it is called, and by what it is known for good."""

    arrive: Arrive
    title: str
    key: str


class Web(Protocol):
    """The face of a protocol towards HTTP."""

    async def open_port(self, where: str, device: WebDevice, names: Sequence[str] = ()) -> Listener:
        """A port of its own. ``names`` are further names by which programs may call this computer. Raises UserError."""

    def add_routes(self, app: Any, devices: Sequence[WebDevice], names: Sequence[str] = ()) -> Callable[[], None]:
        """Serve the devices as a part of an aiohttp application -> what ends that."""
