"""Every row between every presented model and every mount, played and judged: ``tables --check --wire``.

What only asks shares one gateway; whatever may change the mount has one of its own, so that no row stands in the way of
another. The work is spread over the processors.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import NamedTuple

from gateway.app.config import Endpoint
from gateway.diagnostics.command_outcomes import Kind, versions
from gateway.diagnostics.rehearsal.explain import before, counted, greeted, sky, traits
from gateway.diagnostics.rehearsal.judge import Case, differences, writes
from gateway.diagnostics.rehearsal.play import GLANCE, WATCHED, WATCHED_SETTING, Play, Player, stage
from gateway.diagnostics.rehearsal.samples import example
from gateway.diagnostics.virtual_time import run
from gateway.protocols.registry import pairs as protocol_pairs
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import CommandSet, load
from gateway.protocols.wireformat.rows import SurfaceRow

#: What rows ask of a mount that a wedge changes.
BUILDS = ("alt-az", "equatorial")
#: Operations that wait for more of their kind before the mount is told.
SETTINGS = frozenset({"SetSite", "SetClock", "ClockFromGps"})


class Pair(NamedTuple):
    face: Endpoint
    mount: Endpoint

    def __str__(self) -> str:
        return " on ".join(f"{end.model or end.protocol}{f'/{end.version}' if end.version else ''}" for end in self)


class State(NamedTuple):
    """How a mount stands: aligned or before that, a fork in alt-az or on a wedge."""

    aligned: bool = True
    wedge: bool = False


class Difference(NamedTuple):
    protocol: str
    row: str
    words: str
    pair: str


def pairs() -> Iterator[Pair]:
    """Every presented model with every mount of the other protocol, each in all its versions."""
    for client, mount in protocol_pairs():
        for face in _models(client):
            for driven in _models(mount):
                yield Pair(face, driven)


def _models(protocol: str) -> list[Endpoint]:
    found = [Endpoint(protocol, "-", model, version or None) for model, version, _ in versions(load(protocol))]
    return found or [Endpoint(protocol, "-")]


def rehearse(pair: Pair, only: frozenset[str] = frozenset()) -> tuple[int, list[Difference]]:
    """Play all rows of one pair, or some of them -> how many plays there were, and what is different."""
    result: tuple[int, list[Difference]] = run(_rehearse(pair, only))
    return result


async def _rehearse(pair: Pair, only: frozenset[str]) -> tuple[int, list[Difference]]:
    protocol, driven = load(pair.face.protocol), load(pair.mount.protocol)
    commands = [command for name, command in protocol.commands.items() if command.asked and (not only or name in only)]
    found: list[Difference] = []
    plays = 0
    asking = [command for command in commands if not _alone(protocol.surface.get(command.name))]
    async with stage(pair.face, pair.mount, sky()) as shared:
        player = Player(shared)
        for command in asking:
            plays += 1
            found += await _one(pair, player, command, State(), GLANCE)
    for command in commands:
        row = protocol.surface.get(command.name)
        for state in _states(row, driven, pair.mount.model or ""):
            plays += 1
            async with stage(pair.face, pair.mount, sky(), aligned=state.aligned, wedge=state.wedge) as own:
                found += await _one(pair, Player(own), command, state, _long(row))
    return plays, found


def _alone(row: SurfaceRow | None) -> bool:
    """Whether the mount is another after it."""
    return row is not None and bool(writes(row) or row.after or row.during)


def _long(row: SurfaceRow | None) -> float:
    """How long it is watched: a setting waits for its other half."""
    return WATCHED_SETTING if row is not None and SETTINGS.intersection(row.operations) else WATCHED


def _states(row: SurfaceRow | None, driven: CommandSet, model: str) -> Iterator[State]:
    """The states in which a row is played on a mount of its own: all in which the tables say something else."""
    ways = [way for name in (row.operations if row else ()) for way in driven.driver.get(name, ())]
    if _alone(row):
        yield State()
        if any(way.aligned is not None for way in ways):
            yield State(aligned=False)
    if driven.traits(model) != driven.traits(model, wedge=True) and any(way.part in BUILDS for way in ways):
        yield State(wedge=True)


async def _one(pair: Pair, player: Player, command: Command, state: State, watched: float) -> list[Difference]:
    """One row, played and judged."""
    protocol, driven, own = load(pair.face.protocol), load(pair.mount.protocol), player.stage
    row, frame = protocol.surface.get(command.name), example(command)
    said = before(pair.face, row) if row is not None and _alone(row) else greeted(pair.face)
    play: Play = await player.play(frame, said, watched)
    asked = frozenset(found[0].name for data in own.sent() if (found := driven.find(data)) is not None)
    surface = own.face.surface
    case = Case(
        command,
        row,
        traits(pair.face, command),
        driven,
        Kind(pair.mount.model or "", counted(pair.mount), *state),
        bool(surface.lacks(own.face.model, frame)),
    )
    where = f"{pair}{'' if state.aligned else ', not aligned'}{', on a wedge' if state.wedge else ''}"
    return [Difference(protocol.name, command.name, words, where) for words in differences(case, play, surface, asked)]


def check(chosen: Iterable[Pair] | None = None) -> int:
    """Play everything, say what is different -> 0 when nothing is, else 1."""
    work = list(pairs() if chosen is None else chosen)
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn")) as pool:
        results = list(pool.map(rehearse, work, chunksize=4))
    plays = sum(count for count, _ in results)
    found = [difference for _, several in results for difference in several]
    for line in report(found):
        print(line, file=sys.stderr)
    print(f"{len(work)} pair{'s' * (len(work) != 1)} of models, {plays} commands played, {len(found)} differences")
    return 1 if found else 0


def report(found: list[Difference]) -> Iterator[str]:
    """One line for every row and difference, with the pairs that show it."""
    where: dict[tuple[str, str, str], list[str]] = {}
    for protocol, row, words, pair in found:
        where.setdefault((protocol, row, words), []).append(pair)
    for (protocol, row, words), several in sorted(where.items()):
        more = f" and {len(several) - 1} more" if len(several) > 1 else ""
        yield f"mappings/{protocol}/surface.toml: [{row}]: {words} ({several[0]}{more})"
