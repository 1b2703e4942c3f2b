"""The large scale stays simple: no import circles, no crowded folders, no long modules.

That imports point down is held by import-linter (``pyproject.toml``); circles are found by ``support/structure``.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

import gateway
from tests.support import structure
from tests.support.each import each

ROOT = Path(gateway.__file__).parent
FOLDERS = sorted(path.parent for path in ROOT.rglob("__init__.py"))
#: Entries of a folder, lines of a module.
ENTRIES, LINES = 20, 500
#: How often the word may stand in 1,000 lines: what is called so is not checked by mypy.
ANY = 6.0
#: What lies in a folder and is nothing that anybody reads.
NO_PARTS = ("__pycache__", "py.typed")


def test_gateway_has_no_import_cycles() -> None:
    assert structure.circles(structure.import_graph(ROOT)) == []


@each("folder", FOLDERS)
def test_no_source_folder_exceeds_its_entry_limit(folder: Path) -> None:
    entries = sorted(path.name for path in folder.iterdir() if path.name not in NO_PARTS)
    assert len(entries) <= ENTRIES, entries


def test_no_module_exceeds_its_line_limit() -> None:
    lines = {str(path): len(path.read_text("utf-8").splitlines()) for path in ROOT.rglob("*.py")}
    assert {path: count for path, count in lines.items() if count > LINES} == {}


def test_use_of_the_any_type_stays_below_its_limit() -> None:
    texts = [path.read_text("utf-8") for path in ROOT.rglob("*.py")]
    words, lines = (sum(len(re.findall(what, text)) for text in texts) for what in (r"\bAny\b", r"\n"))
    assert words <= ANY * lines / 1000, (words, lines)


def test_no_inner_module_imports_the_public_package() -> None:
    """They stand above all layers, where import-linter has no place for them."""
    public = {"gateway", *(f"gateway.{name}" for name in (*gateway.__all__, "__version__"))}
    for path in ROOT.rglob("*.py"):
        named = structure.imports(path, "")
        plain = {one for one in named if not any(other.startswith(f"{one}.") for other in named)}
        assert not plain & public and not named & (public - {"gateway"}), path


@each("name", ["acceptor.py", "connection.py"])
def test_client_code_sets_attributes_only_on_self(name: str) -> None:
    """Whoever makes a part of a client passes in what it needs, and nobody finishes it from outside."""
    tree = ast.parse((ROOT / "clients" / name).read_text("utf-8"))
    stored = [node for node in ast.walk(tree) if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)]
    foreign = {ast.unparse(node) for node in stored if ast.unparse(node.value) != "self"}
    assert stored and not foreign
