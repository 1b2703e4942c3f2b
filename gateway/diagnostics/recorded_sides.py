"""The protocol of each connection in a recording: the mount's from the settings, a client's from its surface."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from gateway.app.config import parse_endpoint
from gateway.app.recording.format import Event, Recording
from gateway.clients.any_protocol.deciding import protocol_may_change
from gateway.core.wire_log import MOUNT_SIDE
from gateway.diagnostics.log.conversation import ConnectionDecoder
from gateway.protocols.registry import ANY, accepted_protocols


class ConnectionProtocols:
    """The ``protocols`` of a recording by connection name; ``protocols_of_surfaces``: one per surface, in order."""

    def __init__(self, recording: Recording) -> None:
        config = recording.settings["config"]
        self.protocols_of_surfaces = [protocol_of(surface) for surface in config["surface"]]
        #: The number of the surface, from 1, of each client connection.
        self.surface_numbers: dict[str, int] = {}
        self.protocols = {MOUNT_SIDE: protocol_of(config["mount"])}

    def _register(self, side: str, data: bytes) -> int:
        """Register a client's connection; return its surface's number: 2 for ``data`` of ``surface 2, host orion``."""
        number = int(data.split(b",")[0].split()[-1])
        self.surface_numbers[side] = number
        self.protocols[side] = accepted_protocols(self.protocols_of_surfaces[number - 1])[0]
        return number

    def protocol_lines_first(self, lines: Iterable[Event]) -> Iterator[Event]:
        """Yield all lines. If a surface accepts any protocol, a client's first bytes come after the line that names the
        protocol recognised in them, so that they can be decoded.
        """
        held: dict[str, list[Event]] = {}
        for line in lines:
            side, waiting = line.side, held.get(line.side)
            if line.arrow == "+":
                held.pop(side, None)
                if self.protocols_of_surfaces[self._register(side, line.data) - 1] == ANY:
                    held[side] = []
            elif waiting is not None and line.arrow == ">":
                waiting.append(line)
                continue
            elif waiting is not None and line.arrow == "~":
                self.protocols[side] = protocol = line.data.split(b",")[0].decode()  # as in ``nexstar, and why``
                yield line
                yield from waiting
                held[side] = []
                if not protocol_may_change(protocol, b"".join(event.data for event in waiting)):
                    del held[side]
                continue
            elif waiting:
                yield from waiting  # the client continues with its first protocol, or has disconnected
                del held[side]
            yield line
        for waiting in held.values():
            yield from waiting

    def protocol(self, side: str) -> str:
        """Return a connection's protocol; the mount's if the connection was open before the recording began."""
        return self.protocols.get(side, self.protocols[MOUNT_SIDE])

    def decoder(self, side: str) -> ConnectionDecoder:
        """Return a decoder for a connection."""
        return ConnectionDecoder(self.protocol(side))


def protocol_of(settings: dict[str, Any]) -> str:
    """Return the protocol of a mount or a surface in the settings of a recording."""
    return parse_endpoint(settings["at"]).protocol
