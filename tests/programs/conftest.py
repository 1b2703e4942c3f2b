"""What every test with real programs needs: a workshop that ends all it started and tells what they said."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from .processes import Workshop, workshop_in


@pytest.fixture
def workshop(tmp_path: Path) -> Iterator[Workshop]:
    """Processes of one test; the product has to live until it is told to end, and to end with status 0."""
    with workshop_in(tmp_path) as shop:
        yield shop
