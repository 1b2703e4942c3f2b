"""The tables say what the wire carries: every command between every presented model and every mount.

All of it takes some ten minutes on two cores (``pytest --whole``, which a release runs). As a rule some pairs share the
commands, the same in every run: in these every model in every version is presented to programs for every protocol of
mounts, and driven for every protocol of programs, and every command is played at least once.
"""

from __future__ import annotations

from collections import Counter
from itertools import groupby

import pytest

from gateway.protocols.wireformat.command_set import load
from tests.conformance.wire.rehearse import Pair, pairs, rehearse, report
from tests.support.sampling import as_a_rule

PAIRS = list(pairs())


def first_of_each_model() -> list[Pair]:
    """Return the pairs in which a model, in a version, is met for the first time: presented, or driven."""
    result, met = [], set[tuple[object, object]]()
    for pair in PAIRS:
        models: set[tuple[object, object]] = {(pair.face, pair.mount.protocol), (pair.face.protocol, pair.mount)}
        if models - met:
            result.append(pair)
            met |= models
    return result


PLAYED = as_a_rule(first_of_each_model(), whole=PAIRS)


def shares() -> dict[Pair, frozenset[str]]:
    """Deal the commands of each protocol to the pairs that present it, to each as many as all of them need."""
    result = {}
    for protocol, several in groupby(PLAYED, key=lambda pair: pair.face.protocol):
        together = list(several)
        names = [command.name for command in load(protocol).commands.values() if command.requested]
        each = -(-len(names) // len(together))
        for number, pair in enumerate(together):
            result[pair] = frozenset(names[(number * each + one) % len(names)] for one in range(each))
    return result


SHARES = shares()
GROUPS: dict[str, list[Pair]] = {}
for pair in PLAYED:
    GROUPS.setdefault(f"{pair.face.model or pair.face.protocol}-on-{pair.mount.model}", []).append(pair)


@pytest.mark.parametrize("name", GROUPS)
def test_mapping_tables_list_exactly_the_commands_sent_to_the_mount(name: str) -> None:
    found = []
    for pair in GROUPS[name]:
        only = as_a_rule(len(SHARES[pair]), whole=0)
        plays, differences = rehearse(pair, SHARES[pair] if only else frozenset())
        commands = sum(command.requested for command in load(pair.face.protocol).commands.values())
        assert plays >= (only or commands), pair
        found += differences
    assert list(report(found)) == []


def test_wire_test_covers_every_mount_model_and_every_command() -> None:
    """Also a new model and a new row, without being listed."""
    assert len({(str(pair.face), str(pair.mount)) for pair in PAIRS}) == len(PAIRS)
    driven = (load(name).models.keys() for name in ("lx200", "nexstar", "alpaca"))
    assert {pair.mount.model for pair in PLAYED} == set().union(*driven)
    assert {pair.face for pair in PLAYED} == {pair.face for pair in PAIRS}
    assert sum(map(len, GROUPS.values())) == len(PLAYED) == len(SHARES) and all(SHARES.values())
    played = Counter((pair.face.protocol, name) for pair, names in SHARES.items() for name in names)
    for protocol in {pair.face.protocol for pair in PAIRS}:
        asked = {(protocol, command.name) for command in load(protocol).commands.values() if command.requested}
        assert asked <= played.keys()
