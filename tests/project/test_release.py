"""What a release consists of: its version, and files that say the same as the program."""

from __future__ import annotations

import io
import re
import sys
import tarfile
from pathlib import Path

import pytest

from tests.support.doc_blocks import ROOT
from tests.support.each import each

sys.path.insert(0, str(ROOT / "release"))
import build
import deb

import release as making


def test_packaged_unit_runs_the_installed_program() -> None:
    packaged = deb.unit()
    assert "ExecStart=/usr/bin/mount-gateway run --wait --config /etc/mount-gateway/%i.toml\n" in packaged
    assert "StateDirectory=mount-gateway/%i\n" in packaged and "{" not in packaged
    assert "CacheDirectory=mount-gateway\n" in packaged, "no gateway computes the almanac anew at each start"


@each("folder", ["/var/lib/mount-gateway", "/var/cache/mount-gateway", "/etc/mount-gateway"])
def test_package_purge_deletes_the_files_of_a_gateway(folder: str) -> None:
    [line] = re.findall(r"(?m)^ *rm -rf (.*)$", (ROOT / "release" / "debian" / "postrm").read_text("utf-8"))
    assert folder in line.split()


def test_source_distribution_is_reproducible() -> None:
    def packed(mtime: int, owner: str, names: list[str]) -> bytes:
        out = io.BytesIO()
        with tarfile.open(fileobj=out, mode="w:gz") as file:
            for name in names:
                member = tarfile.TarInfo(name)
                member.mtime, member.uname, member.uid, member.size = mtime, owner, mtime, len(name)
                file.addfile(member, io.BytesIO(name.encode()))
        return out.getvalue()

    first = build.packed_again(packed(1, "me", ["a", "b", "a/c"]), 1767225600)
    assert first == build.packed_again(packed(2, "you", ["b", "a/c", "a"]), 1767225600)
    with tarfile.open(fileobj=io.BytesIO(first)) as file:
        members = file.getmembers()
        assert [(one.name, one.mtime, one.uid, one.uname) for one in members] == [
            (name, 1767225600, 0, "") for name in ("a", "a/c", "b")
        ]
        content = file.extractfile("a/c")
        assert content is not None and content.read() == b"a/c"


def test_version_after_a_release_is_the_next_development_version() -> None:
    assert making.following("0.2.0") == "0.3.0.dev0"
    assert making.following("1.9.3") == "1.10.0.dev0"


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The files of which a release changes a line."""
    for name, text in {
        "PROJECT": '[project]\nname = "mount-gateway"\nversion = "0.2.0"\nrequires-python = ">=3.11"\n',
        "CHANGES": "# Changelog\n\n## Unreleased\n\n- A line.\n",
    }.items():
        (tmp_path / name).write_text(text)
        monkeypatch.setattr(making, name, tmp_path / name)
    monkeypatch.setattr(making, "git", lambda *words: "")
    return tmp_path


def test_release_script_writes_version_date_and_heading_and_opens_the_next(project: Path) -> None:
    making.raise_version("0.3.0", released=True)
    assert 'version = "0.3.0"\n' in (project / "PROJECT").read_text()
    assert re.search(r"(?m)^## 0\.3\.0 \(\d{4}-\d\d-\d\d\)$", (project / "CHANGES").read_text())
    making.raise_version("0.4.0.dev0", released=False)
    assert 'version = "0.4.0.dev0"\n' in (project / "PROJECT").read_text()
    assert re.findall(r"(?m)^## (\S+)", (project / "CHANGES").read_text()) == ["Unreleased", "0.3.0"]


@each("words", [["0.3.0", "--no-tests"], ["--check"]])
def test_release_script_reports_what_is_missing_before_any_change(
    project: Path, monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    before = (project / "PROJECT").read_text()
    monkeypatch.setattr("sys.argv", ["release.py", *words])
    monkeypatch.setattr(making, "TOOLS", ("pytest", "no-such-package"))
    monkeypatch.setattr(making, "build", None)
    with pytest.raises(SystemExit, match=r"has no no-such-package.*\.venv/bin/pip install -e '"):
        making.main()
    assert (project / "PROJECT").read_text() == before


@each("version", ["0.3", "v0.3.0", "0.3.0.dev0", "three"])
def test_release_script_refuses_an_invalid_version(version: str) -> None:
    with pytest.raises(SystemExit, match="is no version"):
        making.raise_version(version, released=True)


def test_containerfile_is_short_and_runs_without_root() -> None:
    lines = (ROOT / "release" / "Containerfile").read_text("utf-8").splitlines()
    assert len(lines) <= 25
    assert any(line.startswith("USER ") and "root" not in line for line in lines)
    assert any(line.startswith("HEALTHCHECK ") for line in lines)


def test_container_is_built_from_the_package_alone() -> None:
    everything, *wanted, compiled = (ROOT / ".dockerignore").read_text("utf-8").splitlines()[1:]
    assert (everything, compiled) == ("*", "**/__pycache__")
    package = {"gateway", "mappings", "pyproject.toml", "setup.py", "README.md", "LICENSE"}
    commit = {".git/HEAD", ".git/packed-refs", ".git/refs"}
    assert {line.removeprefix("!") for line in wanted} == package | commit
