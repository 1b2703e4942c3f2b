"""Commands for the user to type, for the environment in which this process runs.

Commands have absolute paths, because the user may be in another folder, and the shell may find another pip, or no
mount-gateway. mount-gateway may also be a single file that contains Python and all packages (pyinstaller). Then
``sys.executable`` is this file, which does not accept ``-m``.
"""

from __future__ import annotations

import os
import re
import sys

#: The option with which the single file runs a script; the build script in docs/tools/ implements it.
RUN_SCRIPT_OPTION = "--run-script"


def is_single_file() -> bool:
    """Whether mount-gateway, Python and all packages are in a single file."""
    return bool(getattr(sys, "frozen", False))


def gateway_argv() -> list[str]:
    """Return the command that starts mount-gateway as a process."""
    return [sys.executable] if is_single_file() else [sys.executable, "-m", "gateway"]


def script_argv(path: str) -> list[str]:
    """Return the command that runs a script of the package in a Python with the standard library only."""
    if is_single_file():
        return [sys.executable, RUN_SCRIPT_OPTION, path]
    return [sys.executable, "-I", "-S", path]


def own_command() -> str:
    """Return the command that starts mount-gateway in any terminal."""
    if is_single_file():
        return sys.executable
    import shutil

    command = shutil.which("mount-gateway", path=os.path.dirname(sys.executable))
    return command or f"{sys.executable} -m gateway"


def pip_command() -> str:
    """Return the pip command to type, for a single file with a remark; pipx environments have no pip of their own."""
    if is_single_file():
        return "in an installed mount-gateway, since one file cannot be added to: pip"
    if os.path.isfile(os.path.join(sys.prefix, "pipx_metadata.json")):
        return "pipx runpip mount-gateway"
    return os.path.join(os.path.dirname(sys.executable), "pip")


def install_instruction(extra: str) -> str:
    """Return the instruction for the user to install an extra of ``pyproject.toml``: what to type, and where."""
    if is_single_file():
        return f"install mount-gateway with pip instead of this one file: pip install '.[{extra}]' in its folder"
    what = " ".join(_packages(extra)) or f"'.[{extra}]' in the folder of mount-gateway"
    return f"type {pip_command()} install {what}"


def _packages(extra: str) -> list[str]:
    """Return the packages of an extra, quoted for a shell; empty if mount-gateway is not installed as a package."""
    from importlib import metadata

    try:
        needed = metadata.requires("mount-gateway") or []
    except metadata.PackageNotFoundError:
        return []
    return [f"'{line.partition(';')[0].strip()}'" for line in needed if re.search(rf"extra == ['\"]{extra}['\"]", line)]
