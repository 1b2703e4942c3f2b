"""Where the catalogues' data files lie: found without importing the packages they came with."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from gateway.core.errors import Unsupported


class NotInstalled(Unsupported):
    """The catalogue's package is missing."""

    words = "Object library not installed."


def data_file(package: str, name: str) -> Path:
    """The data file of an installed package. Raises NotInstalled."""
    found = find_spec(package)
    if found is None or found.origin is None:
        raise NotInstalled
    path = Path(found.origin).parent / name
    if not path.is_file():
        raise NotInstalled
    return path
