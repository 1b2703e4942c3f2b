"""Makes a release: version, tests, files, proof that the files can be installed, and the next version.

    .venv/bin/python release/release.py 0.2.0 [--next 0.3.0.dev0] [--into dist] [--no-tests]

It works on a clean checkout and commits twice: the release, and the beginning of the next version. The files are built
from the first commit; the tag on it, and putting the files anywhere, are the owner's steps. With --check it changes
nothing and proves the files of the present commit, on Python 3.11 and one newer version.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import hashlib
import http.server
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from build import ROOT, build, git

PROJECT, CHANGES = ROOT / "pyproject.toml", ROOT / "CHANGELOG.md"
#: Debian releases whose Python the files are tried on, and for which a package is made.
RELEASES, NUMBERS = ("bookworm", "trixie", "sid"), {"bookworm": "deb12", "trixie": "deb13"}
#: Commands that may be Pythons of this machine.
PYTHONS = ("python3.11", "python3.12", "python3.13", "python3.14")
#: What builds and judges wheel and source distribution, by the names of their packages.
TOOLS = ("build", "check-wheel-contents", "pyroma", "twine")
#: What pyroma may complain of as long as the project has no address: it gives 8 of 10 points then.
WITHOUT_ADDRESS = ("url", "email", "e-mail")
#: The least that pyroma may give.
RATING = 8


def main() -> int:
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("version", nargs="?", help="the version to release, such as 0.2.0")
    words.add_argument("--next", help="the version of the work after it, such as 0.3.0.dev0")
    words.add_argument("--into", type=Path, default=ROOT / "dist", help="the folder of the files (default: dist)")
    words.add_argument("--no-tests", action="store_true", help="the tests have passed already")
    words.add_argument("--check", action="store_true", help="change nothing: prove the files of the present commit")
    given = words.parse_args()
    if given.check == bool(given.version):
        words.error("write the version to release, or --check")
    began = time.monotonic()
    tools = TOOLS if given.check else (*TOOLS, "pyinstaller")
    if lacking := [name for name in tools if not installed(name)]:
        sys.exit(
            f"{sys.executable} has no {', '.join(lacking)}. Type .venv/bin/pip install -e '.[test,dev,single-file]' "
            "and give the command again with .venv/bin/python."
        )
    if given.version:
        if not roots():
            sys.exit("The Debian packages are made in fresh roots of Debian: this needs root, and mmdebstrap.")
        if git("status", "--porcelain"):
            sys.exit("This checkout has changes that are not committed: commit them, or make the release in a clone.")
        if git("tag", "--list", f"v{given.version}"):
            sys.exit(f"There is a tag v{given.version}: what is released stays as it is; release a later version.")
        raise_version(given.version, released=True)
        if not given.no_tests:
            tests()
    into, commit = given.into.resolve(), git("rev-parse", "--short=12", "HEAD")
    step("Wheel and source distribution, built twice and compared")
    wheel, sdist = build(into)
    judged([wheel, sdist])
    packages = [] if given.check else debian_packages(wheel, into)
    missing = tried(wheel, ["trixie"] if given.check else RELEASES)
    if given.version:
        raise_version(given.next or following(given.version), released=False)
    step(f"The files in {into}, after {time.monotonic() - began:.0f} s")
    for path in (wheel, sdist, *packages):
        print(f"{path.stat().st_size / 1e6:6.1f} MB  {hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}")
    for what in missing:
        print(f"not tried: {what}")
    if given.version:
        print(f"The owner's step: git tag -a v{given.version} {commit}")
    return 0


def installed(package: str) -> bool:
    """Whether this Python has a package."""
    with contextlib.suppress(metadata.PackageNotFoundError):
        return bool(metadata.version(package))
    return False


def roots() -> bool:
    """Whether fresh roots of Debian can be made here."""
    return os.geteuid() == 0 and shutil.which("mmdebstrap") is not None


def step(what: str) -> None:
    print(f"== {what}", flush=True)


# --- the version ------------------------------------------------------------------------------------------------------


def following(version: str) -> str:
    """Return the version of the work that follows a release: 0.2.0 is followed by 0.3.0.dev0."""
    major, minor, _ = version.split(".")
    return f"{major}.{int(minor) + 1}.0.dev0"


def raise_version(version: str, released: bool) -> None:
    """Write the version and the changelog's heading, and commit them. A release also gets its date."""
    if not re.fullmatch(r"\d+\.\d+\.\d+" if released else r"\d+\.\d+\.\d+(\.dev0)?", version):
        sys.exit(f"{version!r} is no version: write it like {'0.2.0' if released else '0.3.0.dev0'}.")
    step(f"Version {version}")
    replace(PROJECT, r'(?m)^version = ".*"$', f'version = "{version}"')
    if released:
        now = datetime.now(UTC)
        replace(CHANGES, rf"(?m)^## (Unreleased|{re.escape(version)}.*)$", f"## {version} ({now:%Y-%m-%d})")
    else:
        replace(CHANGES, r"(?m)\A# Changelog\n", "# Changelog\n\n## Unreleased\n")
    if git("status", "--porcelain"):
        git("commit", "-aqm", f"Version {version}")


def replace(path: Path, pattern: str, text: str) -> None:
    """Replace the first match in a file. Ends with a message if there is none."""
    changed, found = re.subn(pattern, lambda _: text, path.read_text("utf-8"), count=1)
    if not found:
        sys.exit(f"{path}: nothing matches {pattern}")
    path.write_text(changed, "utf-8")


# --- proof ------------------------------------------------------------------------------------------------------------


def tests() -> None:
    step("Tests: .ci/run")
    subprocess.run(["bash", str(ROOT / ".ci" / "run")], check=True)
    step("Tests: the parts and the recorded conversations on the Python of Debian sid")
    subprocess.run([str(ROOT / ".ci" / "python"), "sid"], check=True)
    step("Tests: every command between each presented model and mount, nights of real programs, the single file")
    whole = ("tests/conformance/wire", "tests/programs", "tests/project/test_single_file.py")
    subprocess.run([".venv/bin/python", "-bb", "-m", "pytest", "-q", "-n2", "--whole", *whole], cwd=ROOT, check=True)


def judged(files: list[Path]) -> None:
    """Let twine, check-wheel-contents and pyroma judge the files. Ends with a message."""
    step("twine, check-wheel-contents, pyroma")
    subprocess.run([sys.executable, "-m", "twine", "check", "--strict", *map(str, files)], check=True)
    subprocess.run([str(Path(sys.executable).with_name("check-wheel-contents")), str(files[0])], check=True)
    command = [sys.executable, "-m", "pyroma", "--min", str(RATING), str(files[1])]
    said = subprocess.run(command, capture_output=True, text=True)
    print(said.stdout.strip())
    complaints = [line for line in said.stdout.splitlines() if line.startswith(("Your ", "You ", "The "))]
    others = [line for line in complaints if not any(word in line.lower() for word in WITHOUT_ADDRESS)]
    if said.returncode or others:
        sys.exit(f"pyroma complains of more than the missing address: {' '.join(others) or said.stderr}")


@contextlib.contextmanager
def index(wheel: Path) -> Iterator[str]:
    """Serve the wheel as a package index on the loopback address; yield its URL."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "simple" / "mount-gateway"
        place.mkdir(parents=True)
        shutil.copy(wheel, place)
        (place / "index.html").write_text(f'<!doctype html><a href="{wheel.name}">{wheel.name}</a>')
        handler = functools.partial(Quiet, directory=folder)
        with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            yield f"http://127.0.0.1:{server.server_port}/simple/"
            server.shutdown()


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


def tried(wheel: Path, releases: tuple[str, ...] | list[str]) -> list[str]:
    """Install the wheel by pip, pipx and uv on every Python that can be had; return those that cannot."""
    step("Installed from an index by pip, pipx and uv, and the demo run")
    missing, version = [], wheel.name.split("-")[1]
    own = [sys.executable] if len(releases) == 1 else [name for name in PYTHONS if runs(name)]
    missing += [name for name in PYTHONS if len(releases) > 1 and name not in own]
    with index(wheel) as url:
        for python in own:
            subprocess.run([python, str(ROOT / "release" / "tried.py"), url, version], check=True)
        for release in releases:
            if not roots():
                missing.append(f"Debian {release}: it needs root and mmdebstrap")
                continue
            print(f"-- Debian {release}", flush=True)
            inside = f"python3 release/tried.py {url} {version}"
            done = subprocess.run([str(ROOT / ".ci" / "debian"), release, "python3-venv", "--", inside])
            if done.returncode:
                sys.exit(f"The files cannot be installed on Debian {release}.")
    return missing


def runs(python: str) -> bool:
    """Whether a command is a Python that runs and has the venv module."""
    with contextlib.suppress(OSError):
        return subprocess.run([python, "-c", "import ensurepip, venv"], capture_output=True).returncode == 0
    return False


def debian_packages(wheel: Path, into: Path) -> list[Path]:
    """Make the Debian packages, and try those of this machine in fresh roots. Return all of them."""
    step("Debian packages: made, installed, upgraded, removed, purged")
    version = wheel.name.split("-")[1]
    for release in NUMBERS:
        debian(
            into, release, "python3-venv python3-pip", f"python3 release/deb.py /shared/{wheel.name} {version} /shared"
        )
        print(f"-- Debian {release}", flush=True)
        [own] = into.glob(f"mount-gateway_{version}-1~{NUMBERS[release]}_amd64.deb")
        debian(into, release, "", f"sh release/debian/trial.sh /shared/{own.name}")
    return sorted(into.glob(f"mount-gateway_{version}-*.deb"))


def debian(shared: Path, release: str, packages: str, inside: str) -> None:
    """Run a command in a fresh root of a Debian release. Ends with a message."""
    command = [str(ROOT / ".ci" / "debian"), release, *packages.split(), "--", inside]
    if subprocess.run(command, env={**os.environ, "SHARED": str(shared)}).returncode:
        sys.exit(f"On Debian {release} this failed: {inside}")


if __name__ == "__main__":
    sys.exit(main())
