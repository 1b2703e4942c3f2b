"""Every row of ``tests/mutations.py`` still finds the places of the source that it is to break."""

from __future__ import annotations

from tests.mutations import MUTATIONS, ROOT, Mutation
from tests.support.each import each


@each("mutation", MUTATIONS)
def test_mutation_pattern_matches_the_stated_number_of_code_places(mutation: Mutation) -> None:
    matches = [number for _, number in mutation.applied(ROOT).values()]
    assert sum(matches) == mutation.places, mutation.what


@each("mutation", MUTATIONS)
def test_test_files_named_by_each_mutation_exist(mutation: Mutation) -> None:
    assert all((ROOT / test).exists() for test in mutation.tests.split()), mutation.tests
