"""Builds the wheel and the source distribution of a commit, so that the same commit gives the same bytes.

The source is what the commit holds, with one more file that names it. All times are that of the commit, and files may
be read by everybody, whatever the umask of who builds; the source distribution is packed again, sorted and without
owners, because setuptools writes the hour and the user into it. Both are built twice, in different folders and under
different umasks, and compared.
"""

from __future__ import annotations

import gzip
import io
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def build(into: Path) -> list[Path]:
    """Build the present commit twice and return its wheel and its source distribution. Ends with a message."""
    with tempfile.TemporaryDirectory() as folder:
        own = os.umask(0o022)
        first = _built(Path(folder) / "one")
        os.umask(0o002)
        second = _built(Path(folder) / "another-folder")
        os.umask(own)
        if {path.name: path.read_bytes() for path in first} != {path.name: path.read_bytes() for path in second}:
            sys.exit("The two builds differ: some file of them depends on the folder, the hour or the umask.")
        into.mkdir(parents=True, exist_ok=True)
        return [Path(shutil.copy(path, into)) for path in first]


def _built(folder: Path) -> list[Path]:
    """Build the present commit once, in ``folder``."""
    source, made = folder / "source", folder / "made"
    source.mkdir(parents=True)
    command = ["git", "-c", "tar.umask=0022", "archive", "HEAD"]
    archive = subprocess.run(command, cwd=ROOT, check=True, capture_output=True).stdout
    subprocess.run(["tar", "-x", "-C", str(source)], input=archive, check=True)
    told = source / "gateway" / "commit.txt"
    told.write_text(git("rev-parse", "HEAD") + "\n")
    told.chmod(0o644)
    epoch = int(git("log", "-1", "--format=%ct"))
    command = [sys.executable, "-m", "build", "--outdir", str(made), str(source)]
    fixed = {**os.environ, "SOURCE_DATE_EPOCH": str(epoch)}
    done = subprocess.run(command, env=fixed, umask=0o022, capture_output=True, text=True, timeout=600)
    if done.returncode:
        sys.exit(f"{' '.join(command)}\n{done.stdout}{done.stderr}")
    [wheel], [sdist] = made.glob("*.whl"), made.glob("*.tar.gz")
    sdist.write_bytes(packed_again(sdist.read_bytes(), epoch))
    return [wheel, sdist]


def packed_again(sdist: bytes, epoch: int) -> bytes:
    """Return a source distribution sorted by name, of one time and of no owner."""
    out = io.BytesIO()
    with (
        tarfile.open(fileobj=io.BytesIO(sdist)) as old,
        gzip.GzipFile(fileobj=out, mode="wb", mtime=epoch, filename="") as zipped,
        tarfile.open(fileobj=zipped, mode="w", format=tarfile.PAX_FORMAT) as new,
    ):
        for member in sorted(old.getmembers(), key=lambda one: one.name):
            member.uid = member.gid = 0
            member.uname = member.gname = ""
            member.mtime, member.pax_headers = epoch, {}
            member.mode = 0o755 if member.isdir() or member.mode & 0o100 else 0o644
            new.addfile(member, old.extractfile(member) if member.isfile() else None)
    return out.getvalue()
