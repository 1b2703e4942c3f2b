"""Looks at this computer: nothing is changed, no byte is sent to a port, and nothing is fetched."""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from gateway import __version__
from gateway.app.control.endpoints import listened
from gateway.app.reach import Scope, look, reachable, unseen
from gateway.diagnostics.detect.ports import here, holder
from gateway.diagnostics.doctor import installed, linux
from gateway.diagnostics.doctor.facts import Facts, Port, Running
from gateway.diagnostics.doctor.places import USUAL
from gateway.system.files import directory
from gateway.system.own_commands import pip_command
from gateway.system.runtime_folders import user_name
from gateway.transport.wires import group_of

#: Programs that are known to disturb serial ports.
MEDDLERS = ("ModemManager", "brltty")
#: Seconds that timedatectl is given.
PATIENCE = 3.0


def gather(state: str | None = None) -> Facts:
    """Everything that the checks look at; ``state`` is the folder that a gateway was told to keep its state in."""
    folder = directory(state)
    groups, active = linux.groups()
    return Facts(
        version=__version__,
        python=sys.version_info[:3],
        system=f"{platform.system()} {platform.release()} ({platform.machine()})",
        now=time.time(),
        published=installed.published(installed.version(installed.DATA)),
        rotation_until=installed.rotation_until(),
        leap_seconds_until=installed.leap_seconds_until(),
        packages=list(installed.needed()),
        missing_extras=installed.missing_extras(),
        ports=list(ports()),
        groups=groups,
        active_groups=active,
        clock_synchronized=clock_synchronized(),
        meddlers=linux.named(MEDDLERS),
        listeners=linux.listening(USUAL),
        state_folder=str(folder),
        state_problem=unwritable(folder),
        gateways=list(running(Scope(folder, alone=state is not None))),
        pip=pip_command(),
    )


def ports() -> Iterator[Port]:
    """All serial ports of this computer. They are not opened: what somebody uses is left alone."""
    for port in here():
        yield Port(
            name=port.url,
            about=port.about,
            usb=not re.match(r"/dev/tty(S|AMA)\d", port.url),
            permitted=os.name != "posix" or os.access(port.url, os.R_OK | os.W_OK),
            group=group_of(port.url),
            holder=holder(port.url),
            modem_manager_ignores=os.name == "posix" and linux.modem_manager_ignores(port.url),
        )


def clock_synchronized() -> bool | None:
    """Whether somebody keeps this computer's clock right; None where that is not told."""
    command = shutil.which("timedatectl")
    if command is None:
        return None
    try:
        asked = [command, "show", "--property=NTPSynchronized", "--value"]
        said = subprocess.run(asked, capture_output=True, text=True, timeout=PATIENCE, check=False).stdout.strip()
    except (OSError, subprocess.TimeoutExpired):
        return None
    return {"yes": True, "no": False}.get(said)


def unwritable(folder: Path) -> str:
    """Why a folder takes no files; empty where it does, or could be made."""
    there = folder
    while not there.exists() and there != there.parent:
        there = there.parent
    if not there.is_dir():
        return f"{there} is no folder"
    if not os.access(there, os.W_OK | os.X_OK):
        return "permission denied" if there == folder else f"permission denied in {there}"
    return "the disk is full" if shutil.disk_usage(there).free == 0 else ""


def running(scope: Scope) -> Iterator[Running]:
    """The gateways that can be asked, and those that are only seen."""
    for _, door in look(scope).gateways:
        if listened(door):
            yield Running(door.pid, door.name or door.mount)
    for process in unseen(scope):
        yield Running(process.pid, user=user_name(process.user), foreign=not reachable(process))
