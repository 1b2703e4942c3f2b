"""Node runs as long as the tests of this folder."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.unit.console.page.node import running


@pytest.fixture(scope="package", autouse=True)
def node() -> Iterator[None]:
    with running():
        yield
