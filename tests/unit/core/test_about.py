"""The version and the commit are told where they are known, and nothing fails where they are not."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import pytest

from gateway.core import about

SHA = "0123456789abcdef0123456789abcdef01234567"
OTHER = "f" * 40


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder in which the package lies, without anything beside it."""
    monkeypatch.setattr(about, "PACKAGE_FOLDER", tmp_path / "gateway")
    (tmp_path / "gateway").mkdir()
    for known in (about.version, about.short_commit):
        known.cache_clear()
    yield tmp_path
    for known in (about.version, about.short_commit):
        known.cache_clear()


def pip_wrote(monkeypatch: pytest.MonkeyPatch, text: str | None) -> None:
    class Installed:
        version = "9.8.7"

        def read_text(self, name: str) -> str | None:
            return text if name == "direct_url.json" else None

    monkeypatch.setattr(metadata, "distribution", lambda name: Installed())


def test_project_version_is_defined_in_one_line() -> None:
    text = (Path(__file__).parents[3] / "pyproject.toml").read_text("utf-8")
    assert re.findall(r'(?m)^version = "(.+)"$', text) == [about.version()]
    assert re.fullmatch(r"\d+\.\d+\.\d+(\.dev0)?", about.version())


def test_version_of_an_installation_needs_no_git_and_no_checkout(
    installed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pip_wrote(monkeypatch, None)
    assert (about.version(), about.short_commit(), about.full_version()) == ("9.8.7", "", "9.8.7")


def test_version_without_an_installation_is_unknown(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", missing)
    assert (about.version(), about.full_version()) == ("unknown", "unknown")


def test_version_is_not_taken_from_another_project_beside_it(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (installed / "pyproject.toml").write_text('[project]\nname = "other"\nversion = "1.0"\n')
    pip_wrote(monkeypatch, None)
    assert about.version() == "9.8.7"


@pytest.mark.parametrize("packed", [False, True])
def test_commit_of_a_checkout_is_reported(installed: Path, packed: bool) -> None:
    git = installed / ".git"
    (git / "refs" / "heads").mkdir(parents=True)
    (git / "HEAD").write_text("ref: refs/heads/main\n")
    if packed:
        (git / "packed-refs").write_text(f"# pack-refs\n{OTHER} refs/heads/main2\n{SHA} refs/heads/main\n")
    else:
        (git / "refs" / "heads" / "main").write_text(f"{SHA}\n")
    assert about.short_commit() == "0123456789ab"


def test_commit_of_a_checkout_without_a_branch_is_reported(installed: Path) -> None:
    (installed / ".git").mkdir()
    (installed / ".git" / "HEAD").write_text(f"{SHA}\n")
    assert about.short_commit() == "0123456789ab"


def test_commit_of_a_further_worktree_is_reported(installed: Path) -> None:
    own = installed / "repository" / "worktrees" / "here"
    own.mkdir(parents=True)
    (installed / ".git").write_text("gitdir: repository/worktrees/here\n")
    (own / "HEAD").write_text("ref: refs/heads/here\n")
    (own / "commondir").write_text("../..\n")
    heads = installed / "repository" / "refs" / "heads"
    heads.mkdir(parents=True)
    (heads / "here").write_text(f"{SHA}\n")
    assert about.short_commit() == "0123456789ab"


@pytest.mark.parametrize(
    ("written", "told"),
    [
        (f'{{"url": "…", "vcs_info": {{"commit_id": "{SHA}", "vcs": "git"}}}}', "0123456789ab"),
        (f'{{"archive_info": {{"hash": "sha256={"0" * 64}"}}, "url": "file:///w.whl"}}', ""),
        ("{}", ""),
        (None, ""),
    ],
)
def test_commit_installed_by_pip_is_reported(
    installed: Path, monkeypatch: pytest.MonkeyPatch, written: str | None, told: str
) -> None:
    pip_wrote(monkeypatch, written)
    assert about.short_commit() == told


def test_commit_of_a_released_wheel_is_reported(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pip_wrote(monkeypatch, None)
    (installed / "gateway" / "commit.txt").write_text(f"{SHA}\n")
    assert about.full_version() == "9.8.7 (commit 0123456789ab)"


@pytest.mark.parametrize(("checkout", "told"), [(f"{SHA}\n", f"{SHA}\n"), ("", None)])
@pytest.mark.parametrize("released", [False, True])
def test_package_build_stores_the_commit_of_its_checkout(
    tmp_path: Path, checkout: str, told: str | None, released: bool
) -> None:
    """A release's own file stays as it is; without a checkout, and without git, the package is built all the same."""
    pytest.importorskip("setuptools")
    for name in ("core", "mappings"):
        (tmp_path / "gateway" / name).mkdir(parents=True)
    for name in ("setup.py", "gateway/__init__.py", "gateway/core/__init__.py", "gateway/core/about.py"):
        (tmp_path / name).write_bytes((Path(__file__).parents[3] / name).read_bytes())
    project = '[project]\nname = "x"\nversion = "1"\n[tool.setuptools.package-data]\n"gateway" = ["commit.txt"]\n'
    (tmp_path / "pyproject.toml").write_text(project)
    if checkout:
        (tmp_path / ".git").mkdir()
        (tmp_path / ".git" / "HEAD").write_text(checkout)
    if released:
        (tmp_path / "gateway" / "commit.txt").write_text(told := f"{OTHER}\n")
    command = [sys.executable, "setup.py", "-q", "build_py", "--build-lib", "built"]
    subprocess.run(command, cwd=tmp_path, env={**os.environ, "PATH": ""}, check=True, timeout=60)
    written = tmp_path / "built" / "gateway" / "commit.txt"
    assert (written.read_text() if written.exists() else None) == told


def test_unreadable_version_files_are_treated_as_missing(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pip_wrote(monkeypatch, None)
    (installed / "gateway" / "commit.txt").write_bytes(b"\xff\xfe")
    (installed / ".git").write_text("gitdir: nowhere\n")
    assert about.short_commit() == ""
