"""What the wire log is told of one client: the same words once for every host, however often it connects."""

from __future__ import annotations

from gateway.core.wire_log import Transcript


class ClientLog:
    """Of the client of this name, which is its host and its port."""

    def __init__(self, name: str, transcript: Transcript) -> None:
        self.name, self.transcript = name, transcript
        self._host = name.rpartition(":")[0]

    @property
    def heard(self) -> bool:
        """Whether anybody listens: without a listener nothing is worked out for one."""
        return bool(self.transcript.sinks)

    def put(self, arrow: str, data: bytes, note: str = "") -> None:
        """Bytes that passed, or were dropped."""
        self.transcript.put(self.name, arrow, data, note)

    def note(self, text: str) -> None:
        self.transcript.note(self.name, text)

    def note_once(self, text: str) -> None:
        """For every host."""
        self.transcript.note_once(self.name, text, self._host)

    def refused(self, text: str) -> None:
        """Something that was asked for is not done."""
        self.transcript.refused(self.name, text)

    def refused_once(self, text: str) -> None:
        """The same, noted once for every host."""
        self.transcript.refused(self.name, text, self._host)
