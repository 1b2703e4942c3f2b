"""Measures which code a command runs through, from the client's bytes to the reply.

It counts with ``sys.setprofile``, only in files of the package: functions that ran, files, calls from one file into
another, and calls from a lower layer up to a higher one. The simulated mount and the event loop that drives it do not
count: a real gateway has a serial port in their place.

Unless ``--first`` is given, the same command was carried out once before, so that work which is done once per process
or once per minute for all clients does not count (loading tables, compiling patterns, the rotation of the Earth and
the position of the Sun); and the mount's state was read just before, as polling does every few seconds.

    python -m tests.support.walk [--first | --read MOUNT] [BYTES]
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
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge

ROOT = str(Path(gateway.__file__).parent)
#: From the lowest layer to the highest.
LAYERS = ("core", "system", "astro", "transport", "protocols", "mount", "clients", "app", "diagnostics", "cli")
#: Files of the simulated mount, and files that only pass calls on; neither count.
WORLD = ("/simulator/", "protocols/mechanics/", "app/simulated")
PASSED = ("diagnostics/", "core/signals")


class Walk:
    """The counters of one measurement."""

    def __init__(self, layer_of: dict[str, int] | None = None) -> None:
        self.functions: Counter[str] = Counter()
        self.files: Counter[str] = Counter()
        self.hops: Counter[tuple[str, str]] = Counter()
        self.up: Counter[tuple[str, str]] = Counter()
        self._layers = layer_of
        self._last = ""
        self._frames: dict[int, FrameType] = {}

    def event(self, frame: FrameType, event: str, _: Any) -> None:
        """Count one event of ``sys.setprofile``."""
        name = _counted(frame) if event == "call" else ""
        if not name or id(frame) in self._frames or _of_the_world(frame):
            return
        self._frames[id(frame)] = frame  # a coroutine that is resumed is not counted again
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
        """Return the index of a file's layer."""
        if self._layers is not None:
            return self._layers.get(name, 0)
        return LAYERS.index(name.split("/")[0])

    def __str__(self) -> str:
        return (
            f"{len(self.functions)} functions, {len(self.files)} files, {sum(self.hops.values())} hops, "
            f"{sum(self.up.values())} calls up"
        )


def _counted(frame: FrameType) -> str:
    """Return the file's name within the package if it counts, else an empty string."""
    file = frame.f_code.co_filename
    if not file.startswith(ROOT):
        return ""
    name = file[len(ROOT) + 1 :]
    return "" if any(part in name for part in (*WORLD, *PASSED)) else name


def _of_the_world(frame: FrameType | None) -> bool:
    """Whether the frame runs on behalf of the simulated mount."""
    while frame is not None:
        if any(part in frame.f_code.co_filename for part in WORLD):
            return True
        frame = frame.f_back
    return False


def _caller(frame: FrameType) -> FrameType | None:
    """Return the nearest calling frame that counts."""
    back = frame.f_back
    while back is not None and not _counted(back):
        back = back.f_back
    return back


@contextmanager
def walking(walk: Walk) -> Iterator[None]:
    """Count what runs within the block."""
    sys.setprofile(walk.event)
    try:
        yield
    finally:
        sys.setprofile(None)


class _Quiet(Bridge):
    """A gateway without background polling."""

    async def __aenter__(self) -> Any:
        self.controller.start(refresh=False)
        await self.controller.settled.wait()
        return self


#: Seconds that a goto of the simulated mount takes at most.
SLEWS = 300
#: Commands that set a target, and a different one.
TARGET, ANOTHER = b":Sr 05:00:00#:Sd +40:00:00#", b":Sr 05:10:00#:Sd +41:00:00#"


def walk_of(data: bytes, first: bool = False) -> Walk:
    """Measure one client's command over a NexStar, after commands that set its target, with no other client."""
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


#: Seconds after which a reading is too old to be told, and reads before the one that is measured: by then the limits
#: know that the mount rests.
OLD, BEFORE = 2.0, 4
#: Models of a mount of each protocol, and of the other protocol, which the gateway presents.
MODELS = {"nexstar": ("6-8se", "autostar", "lx200"), "lx200": ("autostar", "6-8se", "nexstar")}


def walk_of_read(data: bytes, driven: str) -> Walk:
    """Measure the read of a client of the other protocol for which a resting mount must be asked."""
    walk = Walk()
    model, surface, presented = MODELS[driven]

    async def program() -> None:
        async with _Quiet(model, driven=driven, surface=surface, presented=presented, latency=0.01) as bridge:
            client = bridge.client()
            for _ in range(BEFORE):
                await client.ask(data, until=b"#")
                await asyncio.sleep(OLD)
            with walking(walk):
                assert await client.ask(data, until=b"#")

    run(program())
    return walk


def main() -> None:
    """Print the counts, the calls upwards, and the most frequent calls between files."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--first", action="store_true", help="the first command of a gateway")
    parser.add_argument("--read", choices=MODELS, help="a read, for which a mount of this protocol is asked")
    parser.add_argument("bytes", nargs="?", default=":MS#", help="a command of a client")
    arguments = parser.parse_args()
    data = arguments.bytes.encode()
    walk = walk_of(data, arguments.first) if arguments.read is None else walk_of_read(data, arguments.read)
    print(walk)
    for (caller, callee), count in walk.up.most_common():
        print(f"  up {count}: {caller} -> {callee}")
    for (here, there), count in walk.hops.most_common(40):
        print(f"  {count:3} {here} -> {there}")
    for file, count in walk.files.most_common():
        print(f"  {count:4} {file}")


if __name__ == "__main__":
    main()
