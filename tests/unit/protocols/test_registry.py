"""The list of protocols is the only one: nothing else names them, and a third one takes one entry."""

from __future__ import annotations

import ast
import filecmp
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import gateway
from gateway.app.config import parse_device
from gateway.core.errors import UserError
from gateway.protocols.registry import PROTOCOLS, guess, other_surface, pairs
from gateway.protocols.wireformat.command_set import mappings_folder

ROOT = Path(gateway.__file__).parent
THIRD = Path(__file__).parent / "third"
NAMES = re.compile("lx200|nexstar|meade|celestron|stellarium|alpaca|ascom", re.IGNORECASE)
#: Where a protocol may be named, because a person reads it: help texts, examples of command lines, and documentation
#: that is generated. Only whole sentences and endpoints may name one, never a name or a key.
SAID_TO_PEOPLE = {
    "app/config/checks.py",
    "app/config/keys.py",
    "app/config/reading.py",
    "app/config/tables.py",
    "cli/command_line.py",
    "cli/inspect/detect.py",
    "cli/inspect/tables.py",
    "cli/serve/demo.py",
    "cli/serve/run.py",
    "cli/serve/service.py",
    "cli/serve/settings.py",
    "cli/serve/sim.py",
    "diagnostics/command_tables.py",
    "transport/__init__.py",
}
SENTENCE = re.compile(r"[ @]")


def _literals(tree: ast.AST) -> Iterator[str]:
    """Every text and every name in a module, but for what documents it."""
    documentation = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str | bytes) and id(node) not in documentation:
            yield node.value if isinstance(node.value, str) else node.value.decode("latin-1")
        elif isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr
        elif isinstance(node, ast.alias | ast.keyword | ast.arg):
            yield " ".join(filter(None, (getattr(node, "name", None), getattr(node, "arg", None))))
        elif isinstance(node, ast.ImportFrom):
            yield node.module or ""
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name


def test_nothing_else_names_a_protocol() -> None:
    wrong, seen = [], set()
    for path in sorted(ROOT.rglob("*.py")):
        place = path.relative_to(ROOT).as_posix()
        if place == "protocols/registry.py" or place.split("/")[:2] in (["protocols", name] for name in PROTOCOLS):
            continue
        if not NAMES.search(source := path.read_text("utf-8")):
            continue
        for text in _literals(ast.parse(source)):
            if not NAMES.search(text):
                continue
            if place in SAID_TO_PEOPLE and SENTENCE.search(text):
                seen.add(place)
            else:
                wrong.append(f"{place}: {text[:80]!r}")
    assert wrong == []
    assert seen == SAID_TO_PEOPLE, "the list is too long"


def test_a_third_protocol_is_a_folder_a_folder_of_mappings_and_one_entry(tmp_path: Path) -> None:
    """Decode, sim, explain, tables, run and detect's words go by the list, and its surface pushes."""
    shutil.copytree(ROOT, tmp_path / "gateway")
    shutil.copytree(mappings_folder(), tmp_path / "mappings")
    shutil.copytree(THIRD / "toy", tmp_path / "gateway" / "protocols" / "toy")
    shutil.copytree(THIRD / "mappings", tmp_path / "mappings" / "toy")
    registry = tmp_path / "gateway" / "protocols" / "registry.py"
    text = registry.read_text("utf-8")
    entry = "from gateway.protocols.toy.spec import SPEC as TOY\n\nPROTOCOLS"
    text = text.replace("\nPROTOCOLS", entry, 1).replace("ALPACA)}", "ALPACA, TOY)}")
    registry.write_text(text, "utf-8")
    capture = tmp_path / "capture"
    capture.write_bytes(b"?\n!05:34:32,+22*00:52\n?\n")
    done = subprocess.run(
        [sys.executable, THIRD / "tried.py", capture],
        cwd=tmp_path,
        env={"PYTHONPATH": str(tmp_path), "PATH": "/usr/bin:/bin", "HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    shared = [
        path.relative_to(ROOT).as_posix()
        for path in ROOT.rglob("*.py")
        if not filecmp.cmp(path, tmp_path / "gateway" / path.relative_to(ROOT), shallow=False)
    ]
    assert shared == ["protocols/registry.py"]


def test_what_the_list_says() -> None:
    assert pairs()[:2] == [("lx200", "nexstar"), ("nexstar", "lx200")]
    assert pairs()[2:] == [(face, mount) for face in ("stellarium", "alpaca") for mount in ("lx200", "nexstar")]
    assert (other_surface("lx200"), other_surface("nexstar")) == ("nexstar", "lx200")
    assert guess(bytes((20, 0, 0, 0, *bytes(16)))) == "stellarium"
    assert (guess(b""), guess(b":GR#"), guess(b"\x06"), guess(b"#:GR#"), guess(b"e")) == (
        None,
        "lx200",
        "lx200",
        "lx200",
        "nexstar",
    )
    for name, spec in PROTOCOLS.items():
        assert spec.name == name == spec.commands.name
        assert spec.default_model in (spec.commands.models or [None])


def _imports(path: Path, modules: dict[str, Path]) -> set[str]:
    """The modules that one imports anywhere, in functions and for types as well."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {
                f"{node.module}.{alias.name}" if f"{node.module}.{alias.name}" in modules else node.module
                for alias in node.names
            }
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return found & modules.keys()


def test_no_import_circle_in_protocols() -> None:
    modules = {}
    for path in (ROOT / "protocols").rglob("*.py"):
        parts = path.relative_to(ROOT.parent).with_suffix("").parts
        modules[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    TopologicalSorter({name: _imports(path, modules) - {name} for name, path in modules.items()}).prepare()


@pytest.mark.parametrize("device", ["lx200:autostar/new", "nexstar:cpc/new", "nexstar:cpc/0.5", "nexstar:starsense/9"])
def test_a_version_that_there_never_was_is_refused(device: str) -> None:
    with pytest.raises(UserError, match="version"):
        parse_device(device)
