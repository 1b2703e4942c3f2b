"""The version of this program, the commit that it was built from, its date, and the folder of its package.

pyproject.toml defines the version: a checkout reads it in that file, an installation in its metadata. The commit comes
from the checkout, from pip, or from a file that the build put into the wheel; it is only shown to the user.
"""

from __future__ import annotations

import functools
import re
from pathlib import Path

#: 2026-01-01 in Unix seconds: a clock that shows an earlier time is wrong, because this version did not exist then.
EARLIEST_VALID_TIME = 1767225600.0
#: The folder ``gateway/``, in a checkout or as installed.
PACKAGE_FOLDER = Path(__file__).resolve().parents[1]
#: How many digits of a commit are shown.
COMMIT_DIGITS = 12
_PROJECT_NAME, _COMMIT_PATTERN = "mount-gateway", re.compile(r"[0-9a-f]{40}")


@functools.cache
def version() -> str:
    """Return the version, such as ``0.2.0``; ``unknown`` if it cannot be found."""
    project = _read(PACKAGE_FOLDER.parent / "pyproject.toml")
    if f'name = "{_PROJECT_NAME}"' in project and (match := re.search(r'(?m)^version = "(.+)"$', project)):
        return match[1]
    from importlib import metadata  # it takes longer to import than all that most commands do

    try:
        return metadata.version(_PROJECT_NAME)
    except metadata.PackageNotFoundError:
        return "unknown"


@functools.cache
def short_commit() -> str:
    """Return the first digits of the commit that this was built from; empty if it is not known."""
    built = _read(PACKAGE_FOLDER / "commit.txt") or head_commit(PACKAGE_FOLDER.parent / ".git") or _pip_commit_record()
    return match[0][:COMMIT_DIGITS] if (match := _COMMIT_PATTERN.search(built)) else ""


def full_version(version_number: str | None = None, commit_id: str = "") -> str:
    """Return a version with its commit, if known: ``0.2.0 (commit 55d337efa1b2)``; by default of this program."""
    if version_number is None:
        version_number, commit_id = version(), short_commit()
    return f"{version_number} (commit {commit_id})" if commit_id else version_number


def head_commit(git_path: Path) -> str:
    """Return the commit of a checkout (empty without one), without running git, which a user need not have."""
    if git_path.is_file():  # a further worktree: the file names its folder
        git_path = git_path.parent / _read(git_path).removeprefix("gitdir:").strip()
    head = _read(git_path / "HEAD").strip()
    if not head.startswith("ref: "):
        return head
    common = git_path / (_read(git_path / "commondir").strip() or ".")
    name = head.removeprefix("ref: ")
    packed = re.search(rf"(?m)^([0-9a-f]{{40}}) {re.escape(name)}$", _read(common / "packed-refs"))
    return _read(common / name) or (packed[1] if packed else "")


def _pip_commit_record() -> str:
    """Return the part of pip's record that holds the commit; empty if the package came from an index."""
    from importlib import metadata

    try:
        written = metadata.distribution(_PROJECT_NAME).read_text("direct_url.json") or ""
    except (metadata.PackageNotFoundError, OSError):
        return ""
    return written.partition('"commit_id"')[2]  # there may be checksums before it


def _read(path: Path) -> str:
    """Return the text of a file; empty if it cannot be read."""
    try:
        return path.read_text("utf-8")
    except (OSError, UnicodeDecodeError):
        return ""
