"""The version of this program, the commit that it was built from, its date, and the folder of its package.

pyproject.toml defines the version: a checkout reads it in that file, an installation in its metadata. The commit comes
from the checkout, from pip, or from a file that the build put into the wheel. It is only shown to the user.
"""

from __future__ import annotations

import functools
import re
from pathlib import Path

#: 2026-01-01 in Unix seconds: a clock that shows an earlier time is wrong, because this version did not exist then.
RELEASE_TIME = 1767225600.0
#: The folder ``gateway/``, in a checkout or as installed.
PACKAGE_FOLDER = Path(__file__).resolve().parents[1]
#: How many digits of a commit are shown.
COMMIT_DIGITS = 12
_PROJECT, _COMMIT = "mount-gateway", re.compile(r"[0-9a-f]{40}")


@functools.cache
def version() -> str:
    """Return the version, such as ``0.2.0``."""
    project = _text(PACKAGE_FOLDER.parent / "pyproject.toml")
    if f'name = "{_PROJECT}"' in project and (match := re.search(r'(?m)^version = "(.+)"$', project)):
        return match[1]
    from importlib import metadata  # it takes longer to import than all that most commands do

    try:
        return metadata.version(_PROJECT)
    except metadata.PackageNotFoundError:
        return "unknown"


@functools.cache
def commit() -> str:
    """Return the first digits of the commit that this was built from; empty if it is not known."""
    built = _text(PACKAGE_FOLDER / "commit.txt") or checked_out(PACKAGE_FOLDER.parent / ".git") or _installed_from()
    return match[0][:COMMIT_DIGITS] if (match := _COMMIT.search(built)) else ""


def full_version(number: str | None = None, commit_id: str = "") -> str:
    """Return a version with its commit, if known: ``0.2.0 (commit 55d337efa1b2)``. Default: that of this program."""
    if number is None:
        number, commit_id = version(), commit()
    return f"{number} (commit {commit_id})" if commit_id else number


def checked_out(git: Path) -> str:
    """Return the commit of a checkout, without asking git, which a user need not have."""
    if git.is_file():  # a further worktree: the file names its folder
        git = git.parent / _text(git).removeprefix("gitdir:").strip()
    head = _text(git / "HEAD").strip()
    if not head.startswith("ref: "):
        return head
    common = git / (_text(git / "commondir").strip() or ".")
    name = head.removeprefix("ref: ")
    packed = re.search(rf"(?m)^([0-9a-f]{{40}}) {re.escape(name)}$", _text(common / "packed-refs"))
    return _text(common / name) or (packed[1] if packed else "")


def _installed_from() -> str:
    """Return the part of pip's record that holds the commit; empty if the package came from an index."""
    from importlib import metadata

    try:
        written = metadata.distribution(_PROJECT).read_text("direct_url.json") or ""
    except (metadata.PackageNotFoundError, OSError):
        return ""
    return written.partition('"commit_id"')[2]  # there may be checksums before it


def _text(path: Path) -> str:
    """Return the text of a file; empty if it cannot be read."""
    try:
        return path.read_text("utf-8")
    except (OSError, UnicodeDecodeError):
        return ""
