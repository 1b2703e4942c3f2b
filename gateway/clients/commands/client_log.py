"""What the wire log is told of one client: the same words once for every host, however often it connects."""

from __future__ import annotations

from gateway.core.wire_log import WireLog


class ClientLog:
    """Of the client of this name, which is its host and its port."""

    def __init__(self, name: str, wire_log: WireLog) -> None:
        self.name, self.wire_log = name, wire_log
        self._host = name.rpartition(":")[0]

    @property
    def heard(self) -> bool:
        """Whether anybody listens: without a listener nothing is worked out for one."""
        return bool(self.wire_log.sinks)

    def put(self, arrow: str, data: bytes, note: str = "") -> None:
        """Bytes that passed, or were dropped."""
        self.wire_log.put(self.name, arrow, data, note)

    def note(self, text: str) -> None:
        self.wire_log.note(self.name, text)

    def note_once(self, text: str) -> None:
        """For every host."""
        self.wire_log.note_once(self.name, text, self._host)

    def refused(self, text: str) -> None:
        """Something that was asked for is not done."""
        self.wire_log.refused(self.name, text)

    def refused_once(self, text: str) -> None:
        """The same, noted once for every host."""
        self.wire_log.refused(self.name, text, self._host)
