"""The outcome of a client's command on a kind of mount (translated, refused, …), found in the mapping tables alone."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

from gateway.protocols.registry import PROTOCOLS
from gateway.protocols.wireformat.command_set import CommandSet
from gateway.protocols.wireformat.rows import (
    ANY_MOUNT,
    LACKS_PREFIX,
    PRESENTED_PREFIX,
    UNABLE,
    UNALIGNED,
    Implementation,
    SurfaceRow,
    Version,
)

MISSING_OUTCOME = "missing"  # no table row applies
#: What each outcome means.
OUTCOME_MEANINGS = {
    "translated": "the mount carries it out, by commands of its own protocol",
    "derived": "the reply is computed from other readings of the mount",
    "kept": "the gateway keeps it: a target, a format, a name, a search limit, a setting that the mount cannot take",
    "synthesised": "the mount has nothing like it; the gateway sends a well-formed reply of its own",
    "refused": "the reply is the protocol's refusal; if it has none, the refusal is only logged",
    "silent": "there is no reply, and nothing needs to be done",
}


class MountKind(NamedTuple):
    """A kind of mount: a model and version, aligned or not, and for a fork, whether it is on a wedge."""

    model: str
    version: Version | None = None
    aligned: bool = True
    on_wedge: bool = False  # a fork on a wedge


def outcome(
    row: SurfaceRow | None, mount: CommandSet, kind: MountKind, model_traits: frozenset[str] | None = None
) -> str:
    """Return the outcome of a command for a kind of mount and the traits of the presented model (None: any model).

    If the row says *translated*, return the implementation's outcome, for the first operation that the mount supports.
    """
    if row is None:
        return MISSING_OUTCOME
    ways = choose_ways(row, mount, kind)
    word = next(word for traits, word in row.outcomes.items() if _all_hold(traits, mount, kind, not ways, model_traits))
    if word != "translated":
        return word
    return ways[0].outcome if ways else MISSING_OUTCOME


@cache
def _traits(mount: CommandSet, model: str, wedge: bool) -> frozenset[str]:
    return mount.traits(model, wedge)


def _all_hold(
    condition: str, mount: CommandSet, kind: MountKind, is_unable: bool, model_traits: frozenset[str] | None
) -> bool:
    """Whether all traits of a condition are true. ``is_unable``: the mount can carry out none of the row's operations;
    ``model_traits``: the traits of the presented model, None for any model.
    """

    def is_true(trait: str) -> bool:
        if trait in (ANY_MOUNT, UNABLE, UNALIGNED):
            return trait == ANY_MOUNT or (is_unable if trait == UNABLE else not kind.aligned)
        if trait.startswith(PRESENTED_PREFIX):
            return model_traits is None or trait.removeprefix(PRESENTED_PREFIX) in model_traits
        if trait.startswith(LACKS_PREFIX):
            way = next(possible_implementations(trait.removeprefix(LACKS_PREFIX), mount, kind), None)
            return way is None or way.outcome == "refused"
        return trait in _traits(mount, kind.model, kind.on_wedge)

    return all(map(is_true, condition.split()))


def choose_ways(row: SurfaceRow | None, mount: CommandSet, kind: MountKind) -> list[Implementation]:
    """Return, for each operation of a row, the first implementation that such a mount can carry out, if any."""
    ways = [next(possible_implementations(name, mount, kind), None) for name in ([] if row is None else row.operations)]
    return [way for way in ways if way is not None]


def possible_implementations(operation: str, mount: CommandSet, kind: MountKind) -> Iterator[Implementation]:
    """Yield the implementations that apply to such a mount, also those that refuse; the preferred first."""
    traits = _traits(mount, kind.model, kind.on_wedge)
    for way in mount.driver_rows.get(operation, ()):
        if (way.part and way.part not in traits) or way.aligned not in (None, kind.aligned):
            continue
        needed = [mount.commands[command].exists_on(kind.model, kind.version) for command in way.needs]
        used = [mount.commands[command].exists_on(kind.model, kind.version) for command in way.uses]
        if all(needed) and (needed or not used or any(used)):
            yield way


def model_versions(protocol: CommandSet) -> Iterator[tuple[str, str, Version | None]]:
    """Yield every model with each of its versions: name, version text (empty if none), and its comparable form."""
    spec = PROTOCOLS[protocol.name]
    for model, facts in protocol.models.items():
        for version in spec.versions_of(facts) or [""]:
            yield model, version, spec.command_set_version(version) if version else None


def remarks(row: SurfaceRow | None, implementations: list[Implementation]) -> list[str]:
    """Return what users should know about a row and about how a mount carries it out, each remark once."""
    said = [row.why] if row is not None and row.why else []
    return list(dict.fromkeys(said + [way.why for way in implementations if way.why]))
