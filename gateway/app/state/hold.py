"""The hold on disk: a file in the state folder. While it exists, nothing moves a mount of that folder.

Only the existence of the file counts: an empty one, whoever owns it, holds as well as any other.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from gateway.system.files import flush_folder

NAME = "hold"
WORDS = b"mount-gateway stop --hold: no mount of this folder is moved until mount-gateway stop --release.\n"


def is_held(folder: Path) -> bool:
    """Whether the mounts of a state folder are held."""
    return os.path.lexists(folder / NAME)


def hold(folder: Path) -> None:
    """Hold them, over a power cut too as far as the disk allows. Raises OSError."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    number = os.open(folder / NAME, os.O_WRONLY | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
    with contextlib.suppress(OSError):  # a full disk: the name is enough
        os.write(number, WORDS)
        os.fsync(number)
    os.close(number)
    with contextlib.suppress(OSError):
        flush_folder(folder)


def release(folder: Path) -> bool:
    """Hold them no longer -> whether they were held. Raises OSError."""
    try:
        os.unlink(folder / NAME)
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True
