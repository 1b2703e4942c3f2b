"""Commands for somebody to type, of the very environment that this process runs in.

Who reads them may sit in another folder, before a shell that knows another pip and no mount-gateway; so they are
written with their whole path.
"""

from __future__ import annotations

import os
import shutil
import sys


def own_command() -> str:
    """What starts mount-gateway in any terminal."""
    here = shutil.which("mount-gateway", path=os.path.dirname(sys.executable))
    return here or f"{sys.executable} -m gateway"


def how_to_add(extra: str) -> str:
    """How to install one of the extras of ``pyproject.toml``: what a person types, and where."""
    pip = os.path.join(os.path.dirname(sys.executable), "pip")
    return f"type {pip} install '.[{extra}]' in the folder that mount-gateway was installed from"
