"""Every row of every surface says what becomes of it on every kind of mount, aligned and not, and what it asks for.

Behind the default model a row is played on every kind, behind every other model on a single mount. The models of a
kind differ in their version only, or in numbers; ``test_wire`` plays all of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import pytest

from gateway.app.config import parse_device
from gateway.diagnostics.virtual_time import run
from gateway.protocols.registry import protocol_pairs, surfaces
from gateway.protocols.wireformat.command_set import load
from tests.conformance.wire.rehearse import Pair, operations, rehearse, report

#: Fork (on a wedge, too), German, of before version 2.3, of before 1.6, and other makers'.
KINDS = {
    "nexstar": ["cpc-deluxe/5.31", "cge-pro/5.31", "nexstar-gps/2.2", "gt/101.0", "synscan/4.39.05"],
    "lx200": ["lx200gps", "autostar", "lx200", "onstep", "teenastro", "other"],
    "alpaca": ["german", "altaz", "polar"],
}
#: The models that are presented, and differ in what rows say of them.
PRESENTED = {"lx200": ["lx200gps", "autostar", "lx200"], "nexstar": KINDS["nexstar"]}


def played(client: str, every: bool = False) -> Iterator[Pair]:
    """Yield presented models and mounts; ``every`` one of these with every one of those."""
    faces = [parse_device(f"{client}:{model}") for model in PRESENTED.get(client, ())] or [parse_device(client)]
    protocols = [driven for presented, driven in protocol_pairs() if presented == client]
    kinds = [parse_device(f"{driven}:{model}") for driven in protocols for model in KINDS[driven]]
    for face, mount in product(faces, kinds):
        if every or face is faces[0] or mount is kinds[0]:
            yield Pair(face, mount)


PLAYED = {str(pair): pair for client in surfaces() for pair in played(client)}


@pytest.mark.parametrize("name", PLAYED)
def test_surface_command_has_its_documented_outcome_on_every_mount(name: str) -> None:
    plays, found = rehearse(PLAYED[name])
    assert plays
    assert list(report(found)) == []


@pytest.mark.parametrize("client", surfaces())
def test_surface_command_makes_every_read_that_its_table_row_lists(client: str) -> None:
    """On some mount: what it asks for elsewhere is in its ``asks`` by the test above."""
    left = {name: set(row.asks) for name, row in load(client).surface_rows.items() if row.asks}
    for pair in played(client, every=True):
        for name, asked in run(operations(pair, frozenset(left))):
            left[name] -= asked
        left = {name: unasked for name, unasked in left.items() if unasked}
    assert left == {}
