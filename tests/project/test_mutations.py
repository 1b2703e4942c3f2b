"""Every row of ``tests/mutations.py`` still finds the places of the source that it is to break."""

from __future__ import annotations

from tests.mutations import MUTATIONS, ROOT, Mutation
from tests.support.each import each


@each("mutation", MUTATIONS)
def test_mutation_pattern_matches_as_many_places_as_its_row_says(mutation: Mutation) -> None:
    matches = [number for _, number in mutation.applied(ROOT).values()]
    assert sum(matches) == mutation.places, mutation.what


@each("mutation", MUTATIONS)
def test_test_paths_of_a_mutation_exist(mutation: Mutation) -> None:
    assert all((ROOT / test).exists() for test in mutation.tests.split()), mutation.tests
