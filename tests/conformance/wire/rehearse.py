"""Play and judge rows between a presented model and a mount.

Queries share one gateway; each command that may change the mount has a gateway of its own, so that no row affects
another.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from gateway.app.config import Endpoint
from gateway.app.recording.format import unescape
from gateway.diagnostics.command_outcomes import MountKind, model_versions
from gateway.diagnostics.rehearsal.explain import commands_before, presented_traits, rehearsal_sky, version_tuple
from gateway.diagnostics.rehearsal.play import (
    OBSERVATION_TIME,
    QUERY_OBSERVATION_TIME,
    SETTING_OBSERVATION_TIME,
    Prelude,
    set_up_gateway,
)
from gateway.diagnostics.rehearsal.samples import example_request, sample_value
from gateway.diagnostics.virtual_time import run
from gateway.protocols.registry import PROTOCOLS
from gateway.protocols.registry import protocol_pairs as protocol_pairs
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import CommandSet, load
from gateway.protocols.wireformat.rows import SurfaceRow
from tests.conformance.wire.judge import Case, differences, writes
from tests.conformance.wire.watcher import Watcher

#: Operations that wait for further settings before they are sent to the mount.
SETTINGS = frozenset({"SetSite", "SetClock", "SetZone", "ClockFromGps"})

#: Further values, at which a command asks for something else.
ALSO: dict[tuple[str, str], object] = {
    ("LS", "number"): 903, ("moveaxis", "rate"): 0.0,
    **{(f"slew_{axis}_{sense}", "rate"): 0 for axis in ("azm", "alt") for sense in ("pos", "neg")},
    **{(f"rate_{axis}_{sense}", "rate"): 0xFFFF for axis in ("azm", "alt") for sense in ("pos", "neg")},
}  # fmt: skip


class Pair(NamedTuple):
    face: Endpoint
    mount: Endpoint

    def __str__(self) -> str:
        return " on ".join(f"{end.model or end.protocol}{f'/{end.version}' if end.version else ''}" for end in self)


class State(NamedTuple):
    """The state of a mount: aligned or not, a fork in alt-az or on a wedge."""

    aligned: bool = True
    wedge: bool = False


class Difference(NamedTuple):
    protocol: str
    row: str
    words: str
    pair: str


def pairs() -> Iterator[Pair]:
    """Yield every presented model with every mount of the other protocol, each in all its versions; with a mount that
    speaks a dialect only the default of each protocol, as they differ no more on it than on the others.
    """
    for client, mount in protocol_pairs():
        faces = [face for face in _models(client) if face.model not in load(client).dialect_by_model]
        default = [face for face in faces if face.model == PROTOCOLS[client].default_model][-1]
        for face in faces:
            for driven in _models(mount):
                if driven.model not in load(mount).dialect_by_model or face is default:
                    yield Pair(face, driven)


def _models(protocol: str) -> list[Endpoint]:
    found = [Endpoint(protocol, "-", model, version or None) for model, version, _ in model_versions(load(protocol))]
    return found or [Endpoint(protocol, "-")]


def rehearse(pair: Pair, only: frozenset[str] = frozenset()) -> tuple[int, list[Difference]]:
    """Play all rows of one pair, or only some; return the number of plays and the differences."""
    result: tuple[int, list[Difference]] = run(_rehearse(pair, only))
    return result


async def _rehearse(pair: Pair, only: frozenset[str]) -> tuple[int, list[Difference]]:
    protocol, driven = load(pair.face.protocol), load(pair.mount.protocol).in_dialect_of(pair.mount.model)
    commands = [
        command for name, command in protocol.commands.items() if command.requested and (not only or name in only)
    ]
    found: list[Difference] = []
    plays = 0
    asking = [command for command in commands if not _alone(protocol.surface_rows.get(command.name))]
    for state in _states(driven, pair.mount.model or "") if asking else ():
        async with set_up_gateway(
            pair.face, pair.mount, rehearsal_sky(), aligned=state.aligned, wedge=state.wedge
        ) as shared:
            player = Watcher(shared)
            for command in asking:
                plays += 1
                found += await _one(pair, player, command, state, QUERY_OBSERVATION_TIME)
    for command in commands:
        row = protocol.surface_rows.get(command.name)
        for state in _states(driven, pair.mount.model or "") if _alone(row) else ():
            plays += 1
            async with set_up_gateway(
                pair.face, pair.mount, rehearsal_sky(), aligned=state.aligned, wedge=state.wedge
            ) as own:
                found += await _one(pair, Watcher(own), command, state, _long(row))
    return plays, found


def examples(command: Command) -> list[bytes]:
    """Return requests of this command that differ in what is asked for."""
    values = {name: sample_value(command, name, field) for name, field in command.request.fields.items()}
    also = [values | {field: further} for (name, field), further in ALSO.items() if name == command.name]
    return [command.request.encode(each) for each in (values, *also)]


async def operations(pair: Pair, only: frozenset[str]) -> list[tuple[str, set[str]]]:
    """Return the operations that some rows ask for, also with further values."""
    found = []
    for name in sorted(only):
        command, row = load(pair.face.protocol).commands[name], load(pair.face.protocol).surface_rows[name]
        for frame in examples(command):
            async with set_up_gateway(pair.face, pair.mount, rehearsal_sky()) as own:
                seen = await Watcher(own).watch(frame, commands_before(pair.face, row), _long(row))
            found.append((name, set(seen.asked)))
    return found


def _alone(row: SurfaceRow | None) -> bool:
    """Whether the row may change the mount, and therefore needs a gateway of its own."""
    return row is not None and bool(writes(row) or row.after or row.during)


def _long(row: SurfaceRow | None) -> float:
    """Return how long a row is observed, seconds: a setting may wait for another."""
    return SETTING_OBSERVATION_TIME if row is not None and SETTINGS.intersection(row.operations) else OBSERVATION_TIME


def _states(driven: CommandSet, model: str) -> Iterator[State]:
    """Yield the states in which a mount is played: aligned, not aligned, and a fork on a wedge."""
    yield State()
    if PROTOCOLS[driven.name].has_alignment:
        yield State(aligned=False)
    if driven.traits(model) != driven.traits(model, on_wedge=True):
        yield State(wedge=True)


async def _one(pair: Pair, player: Watcher, command: Command, state: State, watched: float) -> list[Difference]:
    """Play and judge one row."""
    protocol, driven, own = (
        load(pair.face.protocol),
        load(pair.mount.protocol).in_dialect_of(pair.mount.model),
        player.rehearsal,
    )
    row, frame = protocol.surface_rows.get(command.name), example_request(command)
    greeted = Prelude(tuple(map(unescape, PROTOCOLS[pair.face.protocol].required_requests)))
    said = commands_before(pair.face, row) if row is not None and _alone(row) else greeted
    seen = await player.watch(frame, said, watched)
    asked = frozenset(found[0].name for data in {*own.sent_requests()} if (found := driven.find(data)) is not None)
    surface = own.binding.surface
    case = Case(
        command,
        row,
        presented_traits(pair.face, command),
        driven,
        MountKind(pair.mount.model or "", version_tuple(pair.mount), *state),
        bool(surface.lacking_reason(own.binding.model, frame)) or command.name in own.binding.model.get("lacking", ()),
    )
    where = f"{pair}{'' if state.aligned else ', not aligned'}{', on a wedge' if state.wedge else ''}"
    return [Difference(protocol.name, command.name, words, where) for words in differences(case, seen, surface, asked)]


def report(found: list[Difference]) -> Iterator[str]:
    """Yield one line for every row and difference, with the pairs that show it."""
    where: dict[tuple[str, str, str], list[str]] = {}
    for protocol, row, words, pair in found:
        where.setdefault((protocol, row, words), []).append(pair)
    for (protocol, row, words), several in sorted(where.items()):
        more = f" and {len(several) - 1} more" if len(several) > 1 else ""
        yield f"mappings/{protocol}/surface.toml: [{row}]: {words} ({several[0]}{more})"
