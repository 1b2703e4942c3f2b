"""What clients, gateway and mount say to each other, as rows for the pages: the bytes and their meaning.

A client's command gets a number. Its reply, and the exchanges with the mount before that reply, have the same number.
Log entries are collected only while a page shows them; they are made into rows later, so that logging stays fast.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any

from gateway.app.gateway import Gateway
from gateway.core.wire_log import MOUNT_SIDE, Entry, printable
from gateway.diagnostics.log.printing import RowBuilder
from gateway.protocols.registry import ANY

#: How many rows are stored for pages, and how many entries may wait to be made into rows; the oldest are dropped.
MAX_ROWS, MAX_WAITING_ENTRIES = 400, 2000
#: Seconds for which an unanswered command counts as the reason for an exchange with the mount.
CAUSE_WINDOW = 3.0


class ConversationView:
    """The conversation of a mount: stores log entries, and makes rows of them for the next message to pages."""

    def __init__(self, gateway: Gateway, mount_index: int) -> None:
        self._gateway, self._mount_index = gateway, mount_index
        self._entries: deque[Entry] = deque(maxlen=MAX_WAITING_ENTRIES)
        self._is_listening = False
        self._last_command_number = 0
        self._pending_commands: dict[str, tuple[int, float]] = {}
        self._cause_command_number: int | None = None
        #: Side in the log -> surface of that connection; empty for the mount, the gateway, and a closed connection.
        self._surfaces: dict[str, str] = {}
        self._row_builder = self._new_builder()

    def _new_builder(self) -> RowBuilder:
        surfaces = [str(endpoint) for endpoint in self._gateway.endpoints]
        return RowBuilder(self._gateway.mount.protocol, surfaces)

    def listen(self, on: bool) -> None:
        """Begin or end collecting entries."""
        if on == self._is_listening:
            return
        self._is_listening, wire_log = on, self._gateway.wire_log
        if on:
            self._row_builder, self._pending_commands, self._cause_command_number = self._new_builder(), {}, None
            self._surfaces = surface_by_connection(self._gateway)
            for side, surface in self._surfaces.items():
                if (protocol := protocol_and_model(surface).partition(":")[0]) != ANY:
                    self._row_builder.set_protocol(side, protocol)
            wire_log.sinks.append(self._entries.append)
        else:
            self._entries.clear()
            wire_log.remove_sink(self._entries.append)

    def take_rows(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of the entries since the last call."""
        while self._entries:
            entry = self._entries.popleft()
            pair, surface = self._command_number(entry), protocol_and_model(self._surface_of(entry))
            for row in self._row_builder.process(entry):
                yield {  # bytes as printable text, which the page shows as text, never as markup
                    "mount": self._mount_index, "time": round(row.time, 3), "side": printable(row.side.encode()),
                    "arrow": row.arrow, "data": printable(row.data), "words": row.text, "kind": row.kind, "pair": pair,
                    "surface": surface,
                }  # fmt: skip

    def _surface_of(self, entry: Entry) -> str:
        """Return the surface of an entry's connection; look it up again if the entry reports the client's protocol."""
        side, known = entry.side, self._surfaces
        if side not in known or entry.arrow == "~":
            known[side] = "" if side == MOUNT_SIDE else surface_by_connection(self._gateway).get(side, "")
        return known.pop(side) if entry.arrow == "-" else known[side]

    def _command_number(self, entry: Entry) -> int | None:
        """Return the number of the client's command that caused an entry, judged by order and time; None if unknown."""
        if entry.side != MOUNT_SIDE and entry.arrow == ">":
            self._last_command_number += 1
            self._pending_commands[entry.side] = (self._last_command_number, entry.time)
            return self._last_command_number
        if entry.side != MOUNT_SIDE:
            number = self._pending_commands.get(entry.side, (None, 0.0))[0]
            if entry.arrow in "<-":  # not after a note: a refusal is noted first, and its reply follows
                self._pending_commands.pop(entry.side, None)
            return number
        if entry.arrow == ">":  # the mount's answer belongs to the same command, however late it arrives
            waiting = [number for number, at in self._pending_commands.values() if entry.time - at <= CAUSE_WINDOW]
            self._cause_command_number = max(waiting, default=None)
        return self._cause_command_number


def surface_by_connection(gateway: Gateway) -> dict[str, str]:
    """Return a dictionary from the name of every connection in the log to its surface."""
    surfaces = zip(gateway.names(), gateway.acceptors, strict=False)
    return {
        visit.client.log.name: surface_of_client(surface, visit.protocol)
        for surface, acceptor in surfaces
        for visit in acceptor.connections()
    }


def surface_of_client(surface: str, protocol: str) -> str:
    """Return the surface of a client, with the client's protocol if the surface takes any protocol."""
    what, at, where = surface.partition("@")
    return f"{protocol}{at}{where}" if what == ANY else surface


def protocol_and_model(surface: str) -> str:
    """Return protocol and model of a surface without its address, such as ``lx200:autostar``."""
    return surface.partition("@")[0]
