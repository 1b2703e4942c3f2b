"""Wheel and source distribution are whole: the wheel runs the demo in a fresh environment, and the source its tests.

A wheel holds every module and table that the source holds, and nothing else; setuptools has nothing to complain of.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import sysconfig
import venv
import zipfile
from email import message_from_bytes
from email.message import Message
from pathlib import Path

import pytest

from tests.support.doc_blocks import without_code
from tests.support.each import each

ROOT = Path(__file__).parents[2]
#: Prints where the installed package finds its tables.
FOLDER = "from gateway.protocols.wireformat.command_set import mappings_folder as f; print(f())"

#: What stands in a template until somebody writes the real thing, and what else does in a short field.
PLACEHOLDER = r"example\.(?:com|org|net)|\bTODO\b|\bFIXME\b|change-?me|<[a-z -]+>|\bOWNER\b"
IN_A_FIELD = rf"{PLACEHOLDER}|your[-_ ]|\bUSER\b"
#: What lies beside the source where somebody works on it.
BESIDES = ("*.egg-info", "__pycache__", "build", "dist")


def sources() -> list[Path]:
    """All that the project consists of, as it lies at the top."""
    left_out = {path for pattern in (".*", *BESIDES) for path in ROOT.glob(pattern)}
    return sorted({*ROOT.iterdir()} - left_out | {ROOT / ".ci"})


def source_of(tmp_path: Path) -> Path:
    """The source as it is, in a folder where a former build has left a module that is no more."""
    source = tmp_path / "source"
    source.mkdir()
    for path in sources():
        if path.is_dir():
            shutil.copytree(path, source / path.name, ignore=shutil.ignore_patterns("__pycache__", ".hypothesis"))
        else:
            shutil.copy(path, source)
    leave_behind(source)
    return source


def leave_behind(source: Path) -> None:
    """What a former build leaves."""
    left = source / "build" / "lib" / "gateway" / "removed.py"
    left.parent.mkdir(parents=True)
    left.write_text("raise SystemExit('this module is no more')\n")


def built(source: Path, kind: str, into: Path) -> Path:
    """A ``wheel`` or an ``sdist``, made as pip has it made; setuptools may not complain of anything."""
    build = f"from setuptools import build_meta; print(build_meta.build_{kind}({str(into)!r}))"
    done = subprocess.run([sys.executable, "-c", build], timeout=120, cwd=source, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for complaint in ("deprecat", "absent from the `packages`", "!!"):
        assert complaint not in done.stdout.lower() + done.stderr.lower(), done.stderr
    return into / done.stdout.split()[-1]


def installed_files() -> set[str]:
    """What belongs into a wheel: all modules, all tables, and whatever the console shows."""
    files = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "gateway").rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }
    tables = [path for path in (ROOT / "mappings").rglob("*") if path.suffix in (".toml", ".md", ".json", ".txt")]
    return files | {f"gateway/{path.relative_to(ROOT).as_posix()}" for path in tables}


def content(wheel: Path) -> set[str]:
    """The files of a wheel, but for those that say what it is."""
    return {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a source distribution holds."""
    folder = tmp_path_factory.mktemp("release")
    sdist = built(source_of(folder), "sdist", folder)
    (folder / "unpacked").mkdir()
    subprocess.run(["tar", "-xf", sdist, "-C", folder / "unpacked"], check=True)
    [unpacked] = (folder / "unpacked").iterdir()
    return unpacked


@pytest.fixture(scope="module")
def wheel(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of that source distribution."""
    leave_behind(source)
    return built(source, "wheel", tmp_path_factory.mktemp("wheel"))


def placeholders(about: Message) -> list[str]:
    """The placeholders in the fields and in the description of a package; code in the latter is not meant."""
    fields = [f"{name}: {value}" for name, value in about.items()]
    found = [field for field in fields if re.search(IN_A_FIELD, field, re.IGNORECASE)]
    found += [field for field in fields if field.startswith("Project-URL:") and "https://" not in field]
    return found + re.findall(PLACEHOLDER, without_code(str(about.get_payload())), re.IGNORECASE)


def test_wheel_metadata_contains_no_placeholder(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as file:
        [name] = [name for name in file.namelist() if name.endswith(".dist-info/METADATA")]
        about = message_from_bytes(file.read(name))
    assert about["Name"] == "mount-gateway" and "# mount-gateway" in about.get_payload()
    assert placeholders(about) == []


@each(
    "text",
    [
        "Author: Your name",
        "Project-URL: Home, https://example.com",
        "Project-URL: Home, to come",
        "Home-page: <address of the project>",
        "Name: a\n\nTODO",
        "Name: a\n\nSee <address of the project>.",
    ],
)
def test_metadata_check_detects_placeholders_in_a_wheel(text: str) -> None:
    assert placeholders(message_from_bytes(text.encode()))


def test_source_distribution_contains_and_runs_the_tests(source: Path) -> None:
    some = ["tests/unit/core", "tests/project/test_docs_links.py"]
    done = subprocess.run(
        [sys.executable, "-bb", "-m", "pytest", "-q", "-n0", "-p", "no:cacheprovider", *some],
        timeout=120, cwd=source, capture_output=True, text=True, env=environment(),
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    wanted = {path for top in sources() for path in (top, *top.rglob("*")) if not ignored(path)}
    assert [path for path in sorted(wanted) if not (source / path.relative_to(ROOT)).exists()] == []


def ignored(path: Path) -> bool:
    """Whether a file is what running leaves behind."""
    return path.is_dir() or bool({"__pycache__", ".hypothesis"} & set(path.parts))


def environment() -> dict[str, str]:
    """As it is, without what leads Python or pytest elsewhere."""
    return {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "PYTEST"))}


def test_wheel_built_from_a_source_distribution_runs_the_demo(wheel: Path, tmp_path: Path) -> None:
    assert content(wheel) == installed_files()
    fresh = tmp_path / "fresh"
    venv.create(fresh, with_pip=False)
    [site] = fresh.glob("lib/python*/site-packages")
    zipfile.ZipFile(wheel).extractall(site)
    # what it depends on is taken from this environment, the product itself is not
    (site / "dependencies.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
    command = [str(fresh / "bin" / "python"), "-m", "gateway", "demo", "--port", "0", "--pty", str(tmp_path / "lx200")]
    demo = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path, env=environment())
    try:
        assert demo.stdout is not None
        ready = next(line for line in demo.stdout if line.startswith("ready"))
        port = int(ready.rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port), 10) as link:
            link.settimeout(60)
            link.sendall(b":GR#")
            assert re.fullmatch(rb"\d\d:\d\d:\d\d#", link.recv(100))
    finally:
        demo.send_signal(signal.SIGTERM)
        assert demo.wait(60) == 0
        assert demo.stdout is not None
        demo.stdout.close()
    where = subprocess.run(
        [str(fresh / "bin" / "python"), "-c", FOLDER],
        check=True, capture_output=True, text=True, cwd=tmp_path, env=environment(),
    )  # fmt: skip
    assert str(site) in where.stdout
