"""The pages for developers are true of this tree: the picture of the layers, the walk, every path that they name."""

from __future__ import annotations

import re
from pathlib import Path

from tests.support.doc_blocks import PAGES, ROOT
from tests.support.each import each
from tests.support.process import Running
from tests.support.scripts import script

PAGE = (ROOT / "docs" / "architecture.md").read_text("utf-8")
_PATH = re.compile(r"`((?:gateway|mappings|tests|docs|examples)/[\w./*-]+)`")
_WALK = re.compile(r"<!-- walk -->\n```\n(.*?)```\n<!-- end of walk -->", re.DOTALL)


def test_layer_diagram_matches_the_import_contract() -> None:
    layers = script("docs/layers.py")
    assert layers.refreshed(PAGE) == PAGE, "write it anew: python docs/layers.py"
    assert "transport --> core" in layers.picture()
    assert all(name not in layers.reached(layers.imports(), name) for name in layers.layers()), "a circle of layers"


def test_walk_through_the_code_in_the_docs_matches_the_programs_output() -> None:
    printed = Running("explain", "lx200", "nexstar:6-8se", ":MS#").finish().stdout  # it knows nothing of other tests
    written = _WALK.search(PAGE)
    assert written is not None
    assert written[1] == printed


@each("page", PAGES)
def test_every_path_named_in_the_developer_pages_exists(page: Path) -> None:
    gone = [path for path in _PATH.findall(page.read_text("utf-8")) if not any(ROOT.glob(path.rstrip("/")))]
    gone = [path for path in gone if not any(ROOT.glob(f"{path}.py"))]
    assert gone == []


def test_pre_commit_hooks_run_only_programs_that_the_project_installs() -> None:
    text = (ROOT / ".pre-commit-config.yaml").read_text("utf-8")
    entries = re.findall(r"entry: \.venv/bin/(\S+)", text)
    assert entries == ["ruff", "ruff", "mypy", "lint-imports", "codespell", "python"]
    declared = (ROOT / "pyproject.toml").read_text("utf-8")
    for package in ("ruff", "mypy", "import-linter", "codespell", "pre-commit"):
        assert f'"{package}' in declared, f"{package} is no part of the extra dev"


def test_every_file_named_in_a_docstring_exists() -> None:
    """A module that has moved or was renamed must not live on in the words about it."""
    there = {path.name for folder in ("gateway", "mappings", "tests") for path in (ROOT / folder).rglob("*")}
    gone = [
        f"{path.relative_to(ROOT)} names {name}"
        for path in sorted((ROOT / "gateway").rglob("*.py"))
        for name in re.findall(r"``(?:[\w/]+/)?(\w+\.(?:py|toml))``", path.read_text("utf-8"))
        if name not in there | {"gateway.toml", "pyproject.toml"}
    ]
    assert gone == []
