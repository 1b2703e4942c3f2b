"""The wheel is whole: built, installed in a fresh environment, it finds its mappings and runs the demo."""

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
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: Prints where the installed package finds its tables.
FOLDER = "from gateway.protocols.wireformat.command_set import mappings_folder as f; print(f())"


def built(tmp_path: Path) -> Path:
    """The wheel of the source as it is, in a folder where a former build has left a module that is no more."""
    source = tmp_path / "source"
    for name in ("gateway", "mappings"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source / name)
    left = source / "build" / "lib" / "gateway" / "removed.py"
    left.parent.mkdir(parents=True)
    left.write_text("raise SystemExit('this module is no more')\n")
    build = f"from setuptools import build_meta; build_meta.build_wheel({str(tmp_path)!r})"  # what pip calls
    done = subprocess.run([sys.executable, "-c", build], timeout=120, cwd=source, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "deprecat" not in done.stderr.lower(), done.stderr
    [wheel] = tmp_path.glob("*.whl")
    return wheel


def test_the_wheel_runs_the_demo(tmp_path: Path) -> None:
    wheel = built(tmp_path)
    files = zipfile.ZipFile(wheel).namelist()
    assert "gateway/removed.py" not in files and "gateway/__main__.py" in files
    page = {path.relative_to(ROOT).as_posix() for path in (ROOT / "gateway/console/page").rglob("*") if path.is_file()}
    assert page and page <= set(files)
    fresh = tmp_path / "fresh"
    venv.create(fresh, with_pip=False)
    [site] = fresh.glob("lib/python*/site-packages")
    zipfile.ZipFile(wheel).extractall(site)
    # what it depends on is taken from this environment, the product itself is not
    (site / "dependencies.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    command = [str(fresh / "bin" / "python"), "-m", "gateway", "demo", "--port", "0", "--pty", str(tmp_path / "lx200")]
    demo = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path, env=environment)
    try:
        assert demo.stdout is not None
        ready = next(line for line in demo.stdout if line.startswith("ready"))
        port = int(ready.rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port), 10) as link:
            link.settimeout(10)
            link.sendall(b":GR#")
            assert re.fullmatch(rb"\d\d:\d\d:\d\d#", link.recv(100))
    finally:
        demo.send_signal(signal.SIGTERM)
        assert demo.wait(10) == 0
        assert demo.stdout is not None
        demo.stdout.close()
    where = subprocess.run(
        [str(fresh / "bin" / "python"), "-c", FOLDER],
        check=True, capture_output=True, text=True, cwd=tmp_path, env=environment,
    )  # fmt: skip
    assert str(site) in where.stdout
