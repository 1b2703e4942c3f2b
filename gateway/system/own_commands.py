"""Commands for somebody to type, of the very environment that this process runs in.

Who reads them may sit in another folder, before a shell that knows another pip and no mount-gateway; so they are
written with their whole path. mount-gateway may also be one file that holds Python and all packages (pyinstaller): then
``sys.executable`` is this file, and no interpreter that takes ``-m``.
"""

from __future__ import annotations

import os
import shutil
import sys

#: What the single file runs a script by; what makes this file in docs/tools/ writes the other half.
RUN_SCRIPT = "--run-script"


def in_one_file() -> bool:
    """Whether mount-gateway, Python and all packages are one file."""
    return bool(getattr(sys, "frozen", False))


def own_words() -> list[str]:
    """What starts mount-gateway as a process of its own."""
    return [sys.executable] if in_one_file() else [sys.executable, "-m", "gateway"]


def script_words(path: str) -> list[str]:
    """What runs a script of the package that needs the standard library alone, as small as it can be."""
    if in_one_file():
        return [sys.executable, RUN_SCRIPT, path]
    return [sys.executable, "-I", "-S", path]


def own_command() -> str:
    """What starts mount-gateway in any terminal."""
    if in_one_file():
        return sys.executable
    here = shutil.which("mount-gateway", path=os.path.dirname(sys.executable))
    return here or f"{sys.executable} -m gateway"


def pip_command() -> str:
    """What installs packages where this one is: pipx gives its environments no pip of their own."""
    if in_one_file():
        return "in an installed mount-gateway, since one file cannot be added to: pip"
    if os.path.isfile(os.path.join(sys.prefix, "pipx_metadata.json")):
        return "pipx runpip mount-gateway"
    return os.path.join(os.path.dirname(sys.executable), "pip")


def how_to_add(extra: str) -> str:
    """How to install one of the extras of ``pyproject.toml``: what a person types, and where."""
    if in_one_file():
        return f"install mount-gateway with pip instead of this one file: pip install '.[{extra}]' in its folder"
    return f"type {pip_command()} install '.[{extra}]' in the folder that mount-gateway was installed from"
