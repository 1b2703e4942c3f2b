"""Reads the TOML tables of ``mappings/``.

A file that cannot be read raises MappingError with the file and the reason. (tomli, a compiled tomllib, saves
20 ms at the start.)
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import tomli

from gateway.core.about import PACKAGE_FOLDER
from gateway.core.errors import MappingError


def mappings_folder() -> Path:
    """Return the folder ``mappings/``: inside the installed package, or beside it in a checkout."""
    inside = PACKAGE_FOLDER / "mappings"
    return inside if inside.is_dir() else PACKAGE_FOLDER.parent / "mappings"


def read_table(file: str, folder: Path | None = None) -> dict[str, Any]:
    """Read a file like ``lx200/commands.toml`` of ``mappings/``; in ``folder``: only its name. Raises MappingError."""
    path = mappings_folder() / file if folder is None else folder / Path(file).name
    try:
        return tomli.loads(path.read_text("utf-8"))
    except (OSError, tomli.TOMLDecodeError) as error:
        raise MappingError(f"mappings/{file}", "file", str(error)) from None
