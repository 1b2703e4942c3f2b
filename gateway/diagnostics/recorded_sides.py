"""Who speaks which protocol in a recording: the mount as the settings say, a connection as the surface it came to."""

from __future__ import annotations

from typing import Any

from gateway.app.bindings import speech
from gateway.app.config import parse_endpoint
from gateway.app.recording.format import MOUNT, Recording
from gateway.diagnostics.log.conversation import Side


class RecordedSides:
    """``surfaces`` are the protocols of the surfaces, the first one first."""

    def __init__(self, recording: Recording) -> None:
        config = recording.settings["config"]
        self.surfaces = [protocol_of(surface) for surface in config["surface"]]
        self.protocols = {MOUNT: protocol_of(config["mount"])}

    def come(self, side: str, words: bytes) -> int:
        """A connection has come: ``surface 2, host 192.168.1.7`` -> the number of its surface."""
        number = int(words.split(b",")[0].split()[-1])
        self.protocols[side] = self.surfaces[number - 1]
        return number

    def protocol(self, side: str) -> str:
        """The mount's for whoever was there before the recording began."""
        return self.protocols.get(side, self.protocols[MOUNT])

    def side(self, name: str) -> Side:
        """Somebody whose bytes are to be understood."""
        return Side(self.protocol(name), *speech(self.protocol(name)))


def protocol_of(settings: dict[str, Any]) -> str:
    """Of a mount or a surface in the settings of a recording."""
    return parse_endpoint(settings["at"]).protocol
