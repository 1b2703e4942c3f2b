"""The outcome of a command on a mount, on any mount or on one model and version, derived from the mappings alone."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from gateway.protocols.registry import PROTOCOLS
from gateway.protocols.wireformat.command_set import CommandSet, load
from gateway.protocols.wireformat.rows import Implementation, SurfaceRow, Version

MISSING = "missing"
#: What each outcome means.
STANDS_FOR = {
    "translated": "the mount carries it out, by commands of its own protocol",
    "derived": "the reply is computed from other readings of the mount",
    "kept": "the gateway keeps it: a target, a format, a name, a search limit, a setting that the mount cannot take",
    "synthesised": "the mount has nothing like it; the gateway sends a well-formed reply of its own",
    "refused": "the reply is the protocol's refusal; if it has none, the refusal is only logged",
    "silent": "there is no reply, and nothing needs to be done",
}


class Kind(NamedTuple):
    """Which mounts a question is about: any, or those of a model and version.

    ``aligned`` selects mounts after or before their alignment; None means the better outcome of the two. ``wedge``
    selects a fork on a wedge.
    """

    model: str | None = None
    version: Version | None = None
    aligned: bool | None = None
    wedge: bool = False


ANY = Kind()


def outcome(row: SurfaceRow | None, mount: CommandSet, kind: Kind = ANY, *, face: frozenset[str] | None = None) -> str:
    """Return the outcome of a command on such a mount; ``face`` are the traits of the presented model."""
    if row is None:
        return MISSING
    if not is_for(row, mount, kind, face):
        return row.elsewhere or MISSING
    if row.outcome:
        return row.outcome
    ways = taken(row, mount, kind)
    return str(ways[0].outcome) if ways else row.without or MISSING


def is_for(row: SurfaceRow, mount: CommandSet, kind: Kind, face: frozenset[str] | None) -> bool:
    """Whether a row is for such a mount and for a presented model with these traits."""
    if row.models is not None and face is not None and face.isdisjoint(row.models):
        return False
    return kind.model is None or mount.traits(kind.model, kind.wedge).isdisjoint(row.apart)


def taken(row: SurfaceRow | None, mount: CommandSet, kind: Kind = ANY) -> list[Implementation]:
    """Return how a mount carries out the operations of a row: for each the first way whose commands it has."""
    ways = [carried(name, mount, kind) for name in ([] if row is None else row.operations)]
    return [way[0] for way in ways if way]


def carried(operation: str, mount: CommandSet, kind: Kind) -> list[Implementation]:
    """Return the ways in which such a mount can carry out an operation, the one that it takes first."""
    found = []
    model, version, aligned, wedge = kind
    for way in mount.driver.get(operation, ()):
        if way.part and model and way.part not in mount.traits(model, wedge):
            continue
        if None not in (aligned, way.aligned) and aligned != way.aligned:
            continue
        needed = [mount.commands[command].known_to(model, version) for command in way.needs]
        used = [mount.commands[command].known_to(model, version) for command in way.uses]
        if all(needed) and (needed or not used or any(used)):
            found.append(way)
    return found


def sent(row: SurfaceRow | None, mount: CommandSet, kind: Kind = ANY) -> list[str]:
    """Return the mount commands that a row may send, each once; for a model and version only those that it has."""
    has = mount.commands
    commands = [c for way in taken(row, mount, kind) for c in way.commands if has[c].known_to(kind.model, kind.version)]
    return list(dict.fromkeys(commands))


def missing(client: str, mount: str) -> list[str]:
    """Return the commands without an outcome on the newest mount or on any model and version, aligned or not."""
    protocol, driven = load(client), load(mount)
    rows = protocol.surface
    kinds = [ANY, *(Kind(model, version, at) for model, _, version in versions(driven) for at in (True, False))]
    return [
        name
        for name in protocol.commands
        if any(outcome(rows.get(name), driven.of(kind.model), kind) == MISSING for kind in kinds)
    ]


def versions(protocol: CommandSet) -> Iterator[tuple[str, str, Version | None]]:
    """Yield every model with each of its versions: name, version as written (empty if none), version as compared."""
    spec = PROTOCOLS[protocol.name]
    for model, facts in protocol.models.items():
        for version in spec.versions_of(facts) or [""]:
            yield model, version, spec.counts_as(version) if version else None


def remarks(row: SurfaceRow | None, ways: list[Implementation]) -> list[str]:
    """Return what users should know about a row and about how a mount carries it out, each remark once."""
    said = [row.why] if row is not None and row.why else []
    return list(dict.fromkeys(said + [way.why for way in ways if way.why]))
