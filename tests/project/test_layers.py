"""The layers of the package: imports point down only, no folder is crowded, and no protocol knows another."""

from __future__ import annotations

import ast
from pathlib import Path

import gateway

ROOT = Path(gateway.__file__).parent
#: From the highest to the lowest; what stands in one row does not know of each other.
LAYERS = (
    "__main__", "cli", "console", "diagnostics", "app", "clients", "mount", "protocols", "transport", "astro",
    "system", "core", "__init__",
)  # fmt: skip


def _imports(path: Path) -> set[str]:
    """Every module imported anywhere in a file, ``gateway.x`` as written."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} if node.module != "gateway" else {f"gateway.{alias.name}" for alias in node.names}
    return names


def test_imports_point_down() -> None:
    wrong = []
    for path in sorted(ROOT.rglob("*.py")):
        mine = LAYERS.index(path.relative_to(ROOT).with_suffix("").parts[0])
        for imported in _imports(path):
            parts = imported.split(".")
            if parts[0] == "gateway" and len(parts) > 1 and parts[1] in LAYERS and LAYERS.index(parts[1]) < mine:
                wrong.append(f"{path.relative_to(ROOT)} imports {imported}")
    assert wrong == []


def test_no_protocol_knows_another() -> None:
    names = {folder.name for folder in (ROOT.parent / "mappings").iterdir() if folder.is_dir()}
    wrong = [
        f"{path.relative_to(ROOT)} imports {imported}"
        for path in (ROOT / "protocols").rglob("*.py")
        if path.name != "registry.py"
        for imported in _imports(path)
        if imported.startswith("gateway.protocols.")
        and imported.split(".")[2] in names - {path.relative_to(ROOT / "protocols").parts[0]}
    ]
    assert wrong == []
