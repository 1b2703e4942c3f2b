"""What becomes of a command on a mount: of any, or of one model and version; worked out from the mappings alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

from gateway.protocols.registry import PROTOCOLS
from gateway.protocols.wireformat.command_set import CommandSet, load
from gateway.protocols.wireformat.rows import Implementation, SurfaceRow, Version

MISSING = "missing"
#: What each outcome stands for.
STANDS_FOR = {
    "translated": "carried out on the mount by that mount's own commands",
    "derived": "answered from other things the mount tells",
    "kept": "the gateway keeps it: a target, a format, a name, a search limit, what a mount is not told",
    "synthesised": "the mount has no such thing; a syntactically right reply stands in",
    "refused": "no is said in the protocol's form for it; where it has none, the log says so",
    "silent": "nothing is said, and nothing needs doing",
}


class Kind(NamedTuple):
    """Which mounts are asked about: any, or those of a model and version.

    ``aligned`` asks for an aligned mount or for one before its alignment; without it the best of both is told.
    ``wedge`` asks for a fork on a wedge.
    """

    model: str | None = None
    version: Version | None = None
    aligned: bool | None = None
    wedge: bool = False


ANY = Kind()


def outcome(row: SurfaceRow | None, mount: CommandSet, kind: Kind = ANY, *, face: frozenset[str] | None = None) -> str:
    """What becomes of a command on such a mount; ``face``: the presented one's traits."""
    if row is None:
        return MISSING
    if row.models is not None and face is not None and face.isdisjoint(row.models):
        return row.elsewhere or MISSING
    if row.apart and kind.model is not None and not mount.traits(kind.model, kind.wedge).isdisjoint(row.apart):
        return row.elsewhere or MISSING
    if row.outcome:
        return row.outcome
    if not row.operations:
        return "synthesised" if row.say is not None else "kept"
    ways = taken(row, mount, kind)
    return str(ways[0].outcome) if ways else row.without or MISSING


def taken(row: SurfaceRow | None, mount: CommandSet, kind: Kind = ANY) -> list[Implementation]:
    """The ways by which a mount carries out the operations of a row: of each the first whose commands it has."""
    found = []
    model, version, aligned, wedge = kind
    for name in [] if row is None else row.operations:
        for way in mount.driver.get(name, ()):
            if way.part and model and way.part not in mount.traits(model, wedge):
                continue
            if None not in (aligned, way.aligned) and aligned != way.aligned:
                continue
            needed = [mount.commands[command].known_to(model, version) for command in way.send + way.needs]
            used = [mount.commands[command].known_to(model, version) for command in way.uses]
            if all(needed) and (needed or not used or any(used)):
                found.append(way)
                break
    return found


def sent(row: SurfaceRow | None, mount: CommandSet, kind: Kind = ANY) -> list[str]:
    """The mount commands a row may send (to one model and version, those that it has), each once."""
    has = mount.commands
    commands = [c for way in taken(row, mount, kind) for c in way.commands if has[c].known_to(kind.model, kind.version)]
    return list(dict.fromkeys(commands))


def counts(client: str, mount: str, kind: Kind = ANY) -> Counter[str]:
    """Outcome -> number of commands, beyond-the-manual ones included."""
    protocol, driven = load(client), load(mount)
    rows = protocol.surface
    return Counter(outcome(rows.get(name), driven, kind) for name in protocol.commands)


def missing(client: str, mount: str) -> list[str]:
    """The commands that have no outcome, on the newest mount or on one of the models and versions."""
    protocol, driven = load(client), load(mount)
    rows = protocol.surface
    kinds = [ANY, *(Kind(model, version) for model, _, version in versions(driven))]
    return [
        name for name in protocol.commands if any(outcome(rows.get(name), driven, kind) == MISSING for kind in kinds)
    ]


def versions(protocol: CommandSet) -> Iterator[tuple[str, str, Version | None]]:
    """Every model with each of its versions: name, version as written (empty without one), what it counts as."""
    spec = PROTOCOLS[protocol.name]
    for model, facts in protocol.models.items():
        for version in spec.made_with(facts) or [""]:
            yield model, version, spec.counts_as(version) if version else None


def remarks(row: SurfaceRow | None, ways: list[Implementation]) -> list[str]:
    """What a user should know of a row, and of the ways that one mount takes; each once."""
    said = [row.why] if row is not None and row.why else []
    return list(dict.fromkeys(said + [way.why for way in ways if way.why]))
