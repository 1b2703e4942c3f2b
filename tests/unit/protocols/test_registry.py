"""The list of protocols is the only one: nothing else names them, and a third one takes one entry."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import gateway
from gateway.app.config import parse_device
from gateway.core.errors import UserError
from gateway.protocols.registry import PROTOCOLS, guess_protocol, other_surface, protocol_pairs
from gateway.protocols.wireformat.command_set import mappings_folder
from tests.support.each import each

ROOT = Path(gateway.__file__).parent
THIRD = Path(__file__).parent / "third"
NAMES = re.compile("lx200|nexstar|meade|celestron|stellarium|alpaca|ascom", re.IGNORECASE)
#: Where a protocol may be named, because a person reads it: help texts, examples of command lines, and documentation
#: that is generated. Only whole sentences and endpoints may name one, never a name or a key.
SAID_TO_PEOPLE = {
    "app/config/checks.py", "app/config/keys.py", "app/config/reading.py", "app/config/tables.py",
    "cli/command_line.py", "cli/inspect/detect.py", "cli/inspect/prove.py", "cli/inspect/explain.py",
    "cli/serve/demo.py", "cli/serve/run.py", "cli/serve/settings.py", "cli/serve/sim.py",
    "diagnostics/doctor/checks.py", "transport/__init__.py",
}  # fmt: skip
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


def test_core_modules_contain_no_protocol_names() -> None:
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


def linked(folder: Path, there: Path, but: tuple[str, ...] = ()) -> None:
    """A folder whose entries are those of another one, but for some of them."""
    there.mkdir()
    for path in folder.iterdir():
        if path.name not in (*but, "__pycache__"):
            (there / path.name).symlink_to(path)


def test_adding_a_protocol_takes_two_folders_and_one_registry_entry(tmp_path: Path) -> None:
    """Decode, sim, explain, tables, run and detect's words go by the list, and its surface pushes."""
    protocols = tmp_path / "gateway" / "protocols"
    linked(ROOT, tmp_path / "gateway", but=("protocols", "core"))
    shutil.copytree(ROOT / "core", tmp_path / "gateway" / "core")  # the mappings are looked for beside it
    linked(ROOT / "protocols", protocols, but=("registry.py",))
    linked(mappings_folder(), tmp_path / "mappings")
    shutil.copytree(THIRD / "toy", protocols / "toy")
    shutil.copytree(THIRD / "mappings", tmp_path / "mappings" / "toy")
    text = (ROOT / "protocols" / "registry.py").read_text("utf-8")
    entry = "from gateway.protocols.toy.spec import SPEC as TOY\n\nPROTOCOLS"
    text = text.replace("\nPROTOCOLS", entry, 1).replace("ALPACA)}", "ALPACA, TOY)}")
    (protocols / "registry.py").write_text(text, "utf-8")
    capture = tmp_path / "capture"
    for sent in (b"?\n", b"!05:34:32,", b"+22*00:52\n", b"?\n"):
        with capture.open("a") as file:
            file.write(f"000000.100 TX   0000  {sent.hex(' ').upper()}\n")
    done = subprocess.run(
        [sys.executable, THIRD / "tried.py", capture],
        cwd=tmp_path,
        env={"PYTHONPATH": str(tmp_path), "PATH": "/usr/bin:/bin", "HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    own = {path.name for path in protocols.iterdir() if not path.is_symlink()} - {"__pycache__"}
    assert own == {"registry.py", "toy"}, "all else is what there was"


def test_registry_lists_the_protocols_with_their_roles() -> None:
    assert protocol_pairs()[:2] == [("lx200", "nexstar"), ("nexstar", "lx200")]
    assert protocol_pairs()[2:6] == [
        (face, mount) for face in ("stellarium", "alpaca") for mount in ("lx200", "nexstar")
    ]
    assert protocol_pairs()[6:] == [(face, "alpaca") for face in ("lx200", "nexstar", "stellarium")]
    assert (other_surface("lx200"), other_surface("nexstar")) == ("nexstar", "lx200")
    assert guess_protocol(bytes((20, 0, 0, 0, *bytes(16)))) == "stellarium"
    assert (
        guess_protocol(b""),
        guess_protocol(b":GR#"),
        guess_protocol(b"\x06"),
        guess_protocol(b"#:GR#"),
        guess_protocol(b"e"),
    ) == (None, "lx200", "lx200", "lx200", "nexstar")
    for name, spec in PROTOCOLS.items():
        assert spec.name == name == spec.commands.name
        assert spec.default_model in (spec.commands.models or [None])


@each("device", ["lx200:autostar/new", "nexstar:cpc/new", "nexstar:cpc/0.5", "nexstar:starsense/9"])
def test_nonexistent_firmware_version_is_refused(device: str) -> None:
    with pytest.raises(UserError, match="version"):
        parse_device(device)
