"""How far a command walks through the package, from the client's byte to the reply.

Counted with ``sys.setprofile``, in files of the package only: functions that ran, files, calls from one file into
another, and calls from a lower layer up to a higher one. Neither the simulated mount nor the
event loop that drives it are counted: in their place stand a serial line and a real mount.

The same command has been carried out before, so that what is done once in the life of a process, or once in a minute
for everybody (tables that are read, patterns that are compiled, how the Earth stands and where the Sun is), is not
counted; and the mount has just told its state, as it does every few seconds while anybody asks. ``--first`` counts the
first command of a gateway instead, with all of that.

    python -m tests.support.walk [--first] [BYTES]
"""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import gateway
from gateway.core import operations as op
from tests.support.in_process_gateway import Bridge
from tests.support.virtual import run

ROOT = str(Path(gateway.__file__).parent)
#: From the lowest to the highest.
LAYERS = ("core", "system", "astro", "transport", "protocols", "mount", "clients", "app", "diagnostics", "cli")
#: What stands in for the world outside: the mount, and whatever runs on its account; and what is passed through.
WORLD = ("/simulator/", "protocols/mechanics/", "app/simulated")
PASSED = ("diagnostics/", "core/signals")


class Walk:
    """What was counted."""

    def __init__(self, layer_of: dict[str, int] | None = None) -> None:
        self.functions: Counter[str] = Counter()
        self.files: Counter[str] = Counter()
        self.hops: Counter[tuple[str, str]] = Counter()
        self.up: Counter[tuple[str, str]] = Counter()
        self._layers = layer_of
        self._last = ""
        self._frames: dict[int, FrameType] = {}

    def event(self, frame: FrameType, event: str, _: Any) -> None:
        """For ``sys.setprofile``."""
        name = _counted(frame) if event == "call" else ""
        if not name or id(frame) in self._frames or _of_the_world(frame):
            return
        self._frames[id(frame)] = frame  # a coroutine that goes on is not called again
        caller = _caller(frame)
        here = self._last if caller is None else _counted(caller)
        if here and here != name:
            self.hops[here, name] += 1
            if caller is not None and self.layer(here) < self.layer(name):
                self.up[here, f"{name}:{frame.f_code.co_name}"] += 1
        self._last = name
        self.functions[f"{name}:{frame.f_code.co_firstlineno}"] += 1
        self.files[name] += 1

    def layer(self, name: str) -> int:
        """The place of a file in the layers."""
        if self._layers is not None:
            return self._layers.get(name, 0)
        return LAYERS.index(name.split("/")[0])

    def __str__(self) -> str:
        return (
            f"{len(self.functions)} functions, {len(self.files)} files, {sum(self.hops.values())} hops, "
            f"{sum(self.up.values())} calls up"
        )


def _counted(frame: FrameType) -> str:
    """The file, if it counts."""
    file = frame.f_code.co_filename
    if not file.startswith(ROOT):
        return ""
    name = file[len(ROOT) + 1 :]
    return "" if any(part in name for part in (*WORLD, *PASSED)) else name


def _of_the_world(frame: FrameType | None) -> bool:
    """Whether it runs on account of the simulated mount."""
    while frame is not None:
        if any(part in frame.f_code.co_filename for part in WORLD):
            return True
        frame = frame.f_back
    return False


def _caller(frame: FrameType) -> FrameType | None:
    """The nearest frame of the package that stands behind this one."""
    back = frame.f_back
    while back is not None and not _counted(back):
        back = back.f_back
    return back


@contextmanager
def walking(walk: Walk) -> Iterator[None]:
    """Count what runs meanwhile."""
    sys.setprofile(walk.event)
    try:
        yield
    finally:
        sys.setprofile(None)


class _Quiet(Bridge):
    """A gateway in which nothing is read again in the background."""

    async def __aenter__(self) -> Any:
        self.controller.start(refresh=False)
        await self.controller.settled.wait()
        return self


#: Seconds, at most, in which a goto of the simulated mount is over.
SLEWS = 300
#: What sets a target; the second one is another.
TARGET, ANOTHER = b":Sr 05:00:00#:Sd +40:00:00#", b":Sr 05:10:00#:Sd +41:00:00#"


def walk_of(data: bytes, first: bool = False) -> Walk:
    """The walk of one client's command over a NexStar, after what sets its target, while nothing else asks."""
    walk = Walk()

    async def program() -> None:
        async with _Quiet("6-8se", latency=0.01) as bridge:
            client = bridge.client()
            await client.ask(TARGET, until=b"11")
            if not first:
                await client.ask(data)
                for _ in range(SLEWS):
                    if not await bridge.controller.read_now(op.Slewing()):
                        break
                    await asyncio.sleep(1.0)
                await client.ask(ANOTHER, until=b"11")
                await bridge.controller.read_now(op.Position())
                await bridge.controller.read_now(op.GetStatus())
            with walking(walk):
                await client.ask(data)

    run(program())
    return walk


def main() -> None:
    """Print the walk, and where it goes up."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--first", action="store_true", help="the first command of a gateway")
    parser.add_argument("bytes", nargs="?", default=":MS#", help="a command of an LX200 client")
    arguments = parser.parse_args()
    walk = walk_of(arguments.bytes.encode(), arguments.first)
    print(walk)
    for (caller, callee), count in walk.up.most_common():
        print(f"  up {count}: {caller} -> {callee}")
    for (here, there), count in walk.hops.most_common(40):
        print(f"  {count:3} {here} -> {there}")
    for file, count in walk.files.most_common():
        print(f"  {count:4} {file}")


if __name__ == "__main__":
    main()
