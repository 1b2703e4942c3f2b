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


def pip_command() -> str:
    """What installs packages where this one is: pipx gives its environments no pip of their own."""
    if os.path.isfile(os.path.join(sys.prefix, "pipx_metadata.json")):
        return "pipx runpip mount-gateway"
    return os.path.join(os.path.dirname(sys.executable), "pip")


def how_to_add(extra: str) -> str:
    """How to install one of the extras of ``pyproject.toml``: what a person types, and where."""
    return f"type {pip_command()} install '.[{extra}]' in the folder that mount-gateway was installed from"
