"""Run in a tree that has the toy protocol: every command that goes by the list of protocols, and a whole gateway."""

from __future__ import annotations

import asyncio
import contextlib
import io
import sys
from pathlib import Path

from gateway.cli import main
from gateway.diagnostics.rehearsal.stage import RehearsalGateway
from gateway.diagnostics.virtual_time import run
from gateway.protocols.registry import PROTOCOLS

START = 1769634000.0


def said(*arguments: str) -> tuple[int, str]:
    """What a command line prints, and its exit code."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        try:
            code = main(list(arguments))
        except SystemExit as end:
            code = int(end.code or 0)
    return code, out.getvalue()


async def pushed() -> list[bytes]:
    """What a program of the toy protocol hears that has said nothing, in two seconds; then what it asks for."""
    async with RehearsalGateway("6-8se", start=START, presented="toy", named=True) as stage:
        program = stage.client()
        await asyncio.sleep(2.2)
        heard = program.received.splitlines(keepends=True)
        program.received = b""
        program.send(b"!05:34:32,+22*00:52\n")
        await asyncio.sleep(1.0)
        assert stage.sim.slewing
        program.send(b"!!\n")
        await asyncio.sleep(3.0)
        assert not stage.sim.slewing
        program.close()
        program.received = b""
        await asyncio.sleep(2.0)
        assert program.received == b"", "nothing is sent to a connection that is gone"
    return heard


def tried(capture: Path) -> None:
    """Raises AssertionError."""
    assert list(PROTOCOLS) == ["lx200", "nexstar", "stellarium", "alpaca", "toy"]
    code, text = said("decode", str(capture))
    assert code == 0 and "where it points" in text and "go there: ra 83.6" in text, text
    code, text = said("decode", "--protocol", "toy", str(capture))
    assert code == 0 and "go there" in text, text
    code, text = said("sim", "toy")
    assert code == 2 and "no toy mount can be simulated" in text, text
    code, text = said("run", "--mount", "toy@sim", "--surface", "lx200@tcp://127.0.0.1:0")
    assert code == 2 and "toy mounts cannot be driven" in text, text
    code, text = said("explain", "toy", "6se", "!05:34:32,+22*00:52\\x0a")
    assert code == 0 and "translated" in text and "to the mount: R" in text.replace("r", "R"), text
    code, text = said("explain", "lx200", "nexstar", "?\\x0a")
    assert code == 2 and "it is one of toy" in text, text
    heard = run(pushed())
    assert len(heard) == 5 and all(line.startswith(b"=") for line in heard), heard


if __name__ == "__main__":
    tried(Path(sys.argv[1]))
