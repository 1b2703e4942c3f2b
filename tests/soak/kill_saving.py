"""Kill a gateway's state store at random times while it saves, and read what it has left behind. Standalone.

    python -m tests.soak.kill_saving [--kills 200] [--seed 1] [--directory DIR]

A forked child changes all four sites again and again, each time to one number; the parent kills it without warning and
reads the file: it must be whole, with the same number throughout, and not older than the last one reported as written.
It needs ``os.fork``. A directory on a real disk is a better test than one in memory.
"""

from __future__ import annotations

import argparse
import asyncio
import collections
import os
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

from gateway.app.state import store
from gateway.app.state.file import MarkerContent, read_state
from gateway.protocols.base.session import NamedSite

LONGEST = 0.02


def _save_on(directory: Path, first: int, report: int) -> None:
    """In the child: save one number after the other, and report those that are on the disk."""
    store.WRITE_PERIOD = 0.0

    async def program() -> None:
        kept = store.StateStore("nexstar", "proof", MarkerContent("nexstar@proof", 9600), str(directory), print)
        assert kept.has_lock
        number = first
        while True:
            number += 1
            for index in range(4):
                kept.shared.settings = kept.shared.settings.with_site(index, NamedSite(str(number), 1.0, 2.0))
                kept.shared.changed()
            assert kept._writer is not None
            await asyncio.wait({kept._writer})
            os.write(report, number.to_bytes(4, "big"))

    asyncio.run(program())


def _kill_once(directory: Path, first: int, chance: random.Random) -> tuple[str, int, bool]:
    """Return the problem (empty: none), the number found, and whether the child was killed between write and rename."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            _save_on(directory, first, writer)
        finally:
            os._exit(1)
    os.close(writer)
    heard = os.read(reader, 4)  # saving has begun
    time.sleep(chance.uniform(0.0, LONGEST))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    while piece := os.read(reader, 65536):
        heard += piece
    os.close(reader)
    said = int.from_bytes(heard[-4:], "big") if heard else first
    torn = any(directory.glob(".*.new"))
    try:
        sites = read_state(directory / "nexstar@proof.json").sites
    except (OSError, ValueError) as error:
        return f"not readable: {error}", said, torn
    names = {site.name for site in sites.values()}
    if len(sites) != 4 or len(names) != 1:
        return f"of several numbers: {sorted(map(str, names))}", said, torn
    number = int(names.pop() or 0)
    return ("" if number >= said else f"{number} after {said} was said to be written"), max(number, said), torn


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--directory", type=Path)
    arguments = parser.parse_args()
    chance = random.Random(arguments.seed)
    wrong: collections.Counter[str] = collections.Counter()
    number = between = 0
    began = time.monotonic()
    with tempfile.TemporaryDirectory(dir=arguments.directory) as place:
        for _ in range(arguments.kills):
            problem, number, torn = _kill_once(Path(place), number, chance)
            between += torn
            wrong[problem] += bool(problem)
    for problem, times in (+wrong).items():
        print(f"{times} x {problem}")
    print(
        f"seed {arguments.seed}: {arguments.kills} kills in {time.monotonic() - began:.1f} s, {number} states saved, "
        f"{between} kills between writing beside and renaming, {wrong.total()} unreadable, mixed or lost"
    )
    return 1 if wrong.total() or not arguments.kills else 0


if __name__ == "__main__":
    sys.exit(main())
