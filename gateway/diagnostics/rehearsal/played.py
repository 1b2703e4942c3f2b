"""What the rows of a surface do, as plays on simulated mounts show it: ``mappings/*/played.toml``.

``write`` plays the rows whose digest is not that of their last play: the row, its function, or the set of models has
changed. Each is played behind the models that differ in what rows require, on mounts that differ in what operations
need, aligned and not. What all plays show that is not said by how the mount carries out the operations is written down.
"""

from __future__ import annotations

import inspect
import json
import re
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from types import FunctionType
from typing import Any, NamedTuple
from zlib import crc32

from msgspec.structs import replace

from gateway.app.config import Endpoint
from gateway.app.recording.format import unescape
from gateway.core.tables import mappings_folder, read_table
from gateway.diagnostics.command_outcomes import MISSING, Kind, carried, is_for, outcome, versions
from gateway.diagnostics.rehearsal.explain import before, counted, sky, traits
from gateway.diagnostics.rehearsal.play import Play, Player, stage, watched
from gateway.diagnostics.rehearsal.samples import examples
from gateway.diagnostics.rehearsal.shown import changes, shown
from gateway.diagnostics.virtual_time import run
from gateway.mount.policy import Limits
from gateway.protocols.base.spec import SurfaceSettings
from gateway.protocols.registry import PROTOCOLS, mounts, pairs, surfaces
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import PlayedRow, SurfaceRow

_HEAD = """\
# What the play of each row of surface.toml shows. Written by `mount-gateway tables --write`; do not edit.
#   asks      the operations that the function asks for
#   outcome   if it does not follow from how the mount carries out the operations (driver.toml)
#   without   the outcome on a mount that can do none of them
#   elsewhere the outcome behind a model, or on a mount, that the row is not for
#   of        a digest of the row, its function and the models of the play: if it differs, the row is played again

"""


class Scene(NamedTuple):
    """A presented model, a mount, and whether it is aligned."""

    face: Endpoint
    mount: Endpoint
    aligned: bool = True


class Shown(NamedTuple):
    """What one play has shown."""

    scene: Scene
    asked: tuple[str, ...]
    outcome: str | None
    replied: bool


def stale() -> Iterator[tuple[str, str]]:
    """Yield protocol and name of every row whose play is older than the row or its function, and of every play
    without a row."""
    for protocol in surfaces():
        played = load(protocol).played
        digests = _digests(protocol)
        for name in digests.keys() | played.keys():
            if name not in played or played[name].of != digests.get(name):
                yield protocol, name


def write() -> int:
    """Play the stale rows and write ``played.toml`` of their protocols. Return how many rows were played."""
    rows: dict[str, dict[str, PlayedRow]] = {}
    again = list(stale())
    for protocol, name in again:
        if protocol not in rows:
            rows[protocol], digests = dict(load(protocol).played), _digests(protocol)
        rows[protocol].pop(name, None)
        if name in digests:
            rows[protocol][name] = replace(play_row(protocol, name), of=digests[name])
    for protocol, several in rows.items():
        lines = [_line(name, several[name]) for name in load(protocol).surface]
        (mappings_folder() / protocol / "played.toml").write_text(_HEAD + "".join(lines), "utf-8")
        load.cache_clear()
    return len(again)


def _line(name: str, row: PlayedRow) -> str:
    key = name if re.fullmatch(r"[\w-]+", name, re.ASCII) else json.dumps(name)
    cells = {"asks": row.asks, "outcome": row.outcome, "without": row.without, "elsewhere": row.elsewhere, "of": row.of}
    return f"{key} = {{ {', '.join(f'{cell} = {json.dumps(value)}' for cell, value in cells.items() if value)} }}\n"


# --- what a play depends on -------------------------------------------------------------------------------------------


def _digests(protocol: str) -> dict[str, str]:
    """Return for each row of a surface a digest of its rows as they are written, its function, and the models of its
    play."""
    commands, rows = (read_table(f"{protocol}/{file}.toml") for file in ("commands", "surface"))
    make = PROTOCOLS[protocol].make_surface
    assert make is not None
    functions = make(SurfaceSettings(None, None, None, None, Limits())).surface.handlers
    sources: dict[Callable[..., Any], str] = {}
    models = [str(end) for name in (protocol, *mounts()) for end in _differing(name)]
    digests = {}
    for name, row in rows.items():
        parts = models, commands[name], row, *_source(functions.get(row.get("call")), sources)
        digests[name] = f"{crc32(repr(parts).encode()):08x}"
    return digests


def _source(function: Callable[..., Any] | None, sources: dict[Callable[..., Any], str]) -> Iterator[str]:
    """Yield the source of a function and of the functions beside it that it names."""
    waiting, met = [function], set()
    while waiting:
        one = waiting.pop()
        if not isinstance(one, FunctionType) or one in met:
            continue
        met.add(one)
        sources[one] = sources.get(one) or inspect.getsource(one)
        yield sources[one]
        named = (one.__globals__.get(word) for word in sorted(set(re.findall(r"\w+", sources[one]))))
        waiting += [other for other in named if getattr(other, "__module__", None) == one.__module__]


# --- playing a row ----------------------------------------------------------------------------------------------------


def play_row(protocol: str, name: str) -> PlayedRow:
    """Play a row in all scenes and return what the plays have in common."""
    plays: list[Shown] = []
    row = load(protocol).surface[name]
    for driven in (mount for client, mount in pairs() if client == protocol):
        for scene in _scenes(protocol, driven, row):
            plays += run(_play(scene, name))
    return _common(protocol, name, plays)


async def _play(scene: Scene, name: str) -> list[Shown]:
    protocol, driven = load(scene.face.protocol), load(scene.mount.protocol)
    command, row = protocol.commands[name], protocol.surface[name]
    plays = []
    for frame in examples(command) if command.asked else ():
        async with stage(scene.face, scene.mount, sky(), aligned=scene.aligned) as whole:
            if whole.face.surface.lacks(whole.face.model, frame):
                continue
            play: Play = await Player(whole).play(frame, before(scene.face, row), watched(command, scene.aligned))
            plays.append(
                Shown(scene, play.asked, shown(play, command, row, whole.face.surface, driven), bool(play.reply))
            )
    return plays


def _scenes(client: str, driven: str, row: SurfaceRow) -> Iterator[Scene]:
    """Yield the first face that the row is for on every mount, on the ablest and on the least able one also before
    their alignment; and every face."""
    protocol, at = load(client), _differing(driven)
    fits = row.models or ()
    faces = sorted(
        _differing(client), key=lambda face: bool(fits) and protocol.traits(face.model or "").isdisjoint(fits)
    )
    yield from (Scene(faces[0], mount, aligned=False) for mount in (at[0], at[-1]))
    yield from (Scene(faces[0], mount) for mount in at)
    yield from (Scene(face, at[0]) for face in faces[1:])


@cache
def _differing(protocol: str) -> list[Endpoint]:
    """Return as few models, each of a version, as show every trait that a row requires, its absence, and every way to
    carry out an operation."""
    commands = load(protocol)
    required = {word for row in commands.surface.values() for word in (*(row.models or ()), *row.apart)}
    facets: dict[Endpoint, set[tuple[str, object]]] = {}
    for model, text, version in sorted(versions(commands), key=lambda made: made[2] or (), reverse=True):
        kind, has = Kind(model, version, aligned=True), commands.traits(model)
        facets[Endpoint(protocol, "-", model, text or None)] = {
            *((word, word in has) for word in required),
            *((name, ways.index(taken[0]) if (taken := carried(name, commands, kind)) else None)
              for name, ways in commands.driver.items()),
        }  # fmt: skip
    able = {one: sum(value is not None for _, value in several) for one, several in facets.items()}
    left = {one: facets[one] for one in sorted(facets, key=lambda one: able[one], reverse=True)}
    chosen: list[Endpoint] = []
    while left and (best := max(left, key=lambda one: len(left[one]))) and left[best]:
        chosen.append(best)
        met = left.pop(best)
        left = {one: several - met for one, several in left.items()}
    return sorted(chosen, key=lambda one: able[one], reverse=True) or [Endpoint(protocol, "-")]


def _common(protocol: str, name: str, plays: list[Shown]) -> PlayedRow:
    """Return what the plays of a row show that does not follow from how the mounts carry out its operations."""
    row = load(protocol).surface[name]
    asks = list(dict.fromkeys(operation for play in plays for operation in _deciding(play.asked)))
    if any(map(changes, asks)):
        asks = list(filter(changes, asks))
    bare = replace(row, asks=[] if row.ask else asks, outcome=None, without=None, elsewhere=None)
    required = replace(bare, asks=[*_required(protocol, row), *bare.asks])
    if not row.ask and _contradictions(protocol, name, required, plays) < _contradictions(protocol, name, bare, plays):
        bare = required
    shows: dict[str, Counter[str]] = {"there": Counter(), "without": Counter(), "elsewhere": Counter()}
    follows = False
    for scene, _, became, replied in plays:
        here, said = _tabulated(protocol, name, bare, scene)
        place = "elsewhere" if not here else "without" if said == MISSING else "there"
        if became is None and place == "without":
            became = "synthesised" if replied else "silent"
        follows |= place == "there" and became in (None, said)
        if became is not None and (scene.aligned or place == "without"):
            shows[place][became] += 1
    [there, without, elsewhere] = [count.most_common(1)[0][0] if count else None for count in shows.values()]
    always = None if follows else there or without
    return PlayedRow("", bare.asks, always, None if always else without, elsewhere)


def _required(protocol: str, row: SurfaceRow) -> list[str]:
    """Return the operations that must have been carried out before: a mount that cannot do these refuses the row."""
    commands = load(protocol)
    before = [commands.find(unescape(frame)) for frame in row.after]
    return [name for found in before if found for name in commands.surface[found[0].name].operations if changes(name)]


def _contradictions(protocol: str, name: str, row: SurfaceRow, plays: list[Shown]) -> int:
    """Return how many plays show another outcome than a row on the mounts that it is for."""
    tabulated = ((*_tabulated(protocol, name, row, scene), became) for scene, _, became, _ in plays)
    return sum(here and became not in (None, said) for here, said, became in tabulated)


def _tabulated(protocol: str, name: str, row: SurfaceRow, scene: Scene) -> tuple[bool, str]:
    """Return whether a row is for the face and the mount of a scene, and the outcome that follows from it there."""
    driven, kind = load(scene.mount.protocol), Kind(scene.mount.model, counted(scene.mount), scene.aligned)
    here = is_for(row, driven, kind, traits(scene.face, load(protocol).commands[name]))
    return here, outcome(row, driven, kind)


def _deciding(asked: tuple[str, ...]) -> list[str]:
    """Return the operations that decide what becomes of a command: those that change the mount in their order; if there
    is none, the reads that a mount can be asked for, the last one first, because the reply is made of it."""
    can = {name for mount in mounts() for name in load(mount).driver}
    return [name for name in asked if changes(name)] or [name for name in reversed(asked) if name in can]
