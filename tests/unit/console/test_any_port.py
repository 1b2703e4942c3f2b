"""A port for every protocol, as the console shows it: each program with what it speaks, each command as whose it is."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from gateway.console.mounts import _surface_argument
from gateway.console.shown.publisher import ConnectedPrograms
from tests.support.any_port import AnyBridge
from tests.support.each import each


async def test_console_shows_each_program_with_its_protocol() -> None:
    async with AnyBridge() as bridge:
        gateway: Any = SimpleNamespace(names=lambda: ["any@tcp://127.0.0.1:4040"], acceptors=[bridge.any])
        shown = ConnectedPrograms(gateway)
        bridge.wire_log.sinks.append(shown.put)
        assert list(shown.connections(0.0)) == []
        for said in (b":GR#", b"e"):
            await bridge.call().ask(said)
        told = sorted((one["surface"], one["last"]) for one in shown.connections(1.0))
        assert told == [("lx200@tcp://127.0.0.1:4040", ":GR#"), ("nexstar@tcp://127.0.0.1:4040", "e")]


@each(("surface", "command", "face"), [
    ("any", ":GR#", "lx200"), ("any", "E", "nexstar"), ("any", "\\x06", "lx200"), ("any", "", "lx200"),
    ("any", "GET / HTTP/1.1", "lx200"), ("nexstar:cpc", ":GR#", "nexstar:cpc"),
])  # fmt: skip
def test_console_explains_a_command_in_its_protocol(surface: str, command: str, face: str) -> None:
    assert _surface_argument(surface, command) == face
