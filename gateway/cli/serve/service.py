"""``service``: a systemd unit that fits this installation and its configuration.

The user is a normal one, not a dynamic one: a virtual serial port belongs to whoever opens it, and a dynamic user has
a /tmp of its own, so that no program would ever see /tmp/lx200. The kernel follows a link in /tmp only for its owner,
so by default it is the user who runs the programs. The rest of the system is closed to it, as far as a serial port
allows: ``PrivateDevices`` and ``ProtectClock`` would hide the ports, ``PrivateTmp`` the links.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.command_line import Commands
from gateway.core.errors import UserError
from gateway.system import streams
from gateway.system.own_commands import in_one_file, own_words

if TYPE_CHECKING:
    from gateway.app.config import Config

DEFAULT = Path("/etc/mount-gateway.toml")
#: Who may open serial ports: Debian and most others; Arch.
GROUPS = ("dialout", "uucp")

UNIT = """\
# /etc/systemd/system/mount-gateway.service, made by mount-gateway service
[Unit]
Description=Gateway between LX200 and NexStar programs and mounts
After=network.target
# A mistake in the configuration does not heal by itself, an address that is not there yet does.
StartLimitIntervalSec=300
StartLimitBurst=20

[Service]
Type=notify
User={user}
SupplementaryGroups={group}
ExecStart={program} run --wait --config {config}
# Whatever it ended by, the mount does not go on moving.
{stop}
StateDirectory=mount-gateway
SyslogIdentifier=mount-gateway
# Nobody watches the mount while the gateway hangs: it is ended then, the mount stopped, and the gateway started again.
WatchdogSec=20
Restart=on-failure
RestartSec=5
# Motion is stopped and tracking put back before it ends; a hand control answers within seconds.
TimeoutStopSec=30

# Closed, but for serial ports and the links of virtual ones in /tmp.
NoNewPrivileges=yes
CapabilityBoundingSet=
ProtectSystem=strict
{writable}
ProtectHome=read-only
ProtectControlGroups=yes
ProtectHostname=yes
ProtectKernelLogs=yes
ProtectKernelModules=yes
ProtectKernelTunables=yes
LockPersonality=yes
RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_NETLINK
RestrictNamespaces=yes
RestrictRealtime=yes
RestrictSUIDSGID=yes
SystemCallArchitectures=native
SystemCallFilter=@system-service
SystemCallErrorNumber=EPERM

[Install]
WantedBy=multi-user.target
"""

HOW = """\
Example:
  mount-gateway detect --network --write gateway.toml
  mount-gateway service --config gateway.toml | sudo tee /etc/systemd/system/mount-gateway.service
  sudo systemctl enable --now mount-gateway
  systemctl status mount-gateway        how the mount is
  journalctl -u mount-gateway -f        what is going on
"""


def add_service(commands: Commands) -> None:
    service = commands.add_parser(
        "service", help="a systemd unit that starts the gateway with the computer",
        description="Prints a systemd unit for this installation. It waits for a mount that is switched on later, and "
                    "stops the mount when the gateway ends, however it ends.",
        epilog=HOW,
    )  # fmt: skip
    service.add_argument("file", nargs="?", type=Path, metavar="FILE", help="the same as --config FILE")
    service.add_argument("--config", type=Path, metavar="FILE", default=DEFAULT, help=f"default {DEFAULT}")
    service.add_argument(
        "--user",
        metavar="NAME",
        help="who it runs as: who runs the programs that use its virtual serial ports (default: you)",
    )
    service.set_defaults(run=_service)


def _service(arguments: argparse.Namespace) -> int:
    from gateway.app.config import make_config, read_tables

    path = (arguments.file or arguments.config).absolute()
    if not os.path.lexists(path):
        raise UserError(
            f"{path}: no such file; mount-gateway detect --network --write gateway.toml makes one here, "
            "and mount-gateway service --config gateway.toml takes it"
        )
    config = make_config(*read_tables(path))
    if arguments.user and not _is_user(arguments.user):
        raise UserError(f"service: this computer has no user {arguments.user!r}; systemd would not start it")
    print(unit(config, path, arguments.user or _user(), program()), end="")
    if not any(reached_from_elsewhere(surface.at) for surface in config.surface):
        streams.warn(
            f"only programs on this computer will reach this gateway, no phone: {path} has no surface at "
            "tcp://0.0.0.0:4030",
            streams.INFO,
        )
    return 0


def reached_from_elsewhere(at: str) -> bool:
    """Whether a surface is for more than the programs on this computer: on the network, or on a real serial port."""
    from gateway.transport.tcp import exposed

    where = at.partition("@")[2]
    return not where.startswith("pty:") and (exposed(where) or "://" not in where)


def unit(config: Config, path: Path, user: str, run: list[str]) -> str:
    """The unit that runs the words ``run`` with the configuration that was read from a path. Raises UserError."""
    program = " ".join([word(run[0], variables=False), *map(word, run[1:])])
    states = {None if mount.state is None else absolute(mount.state, path) for mount in config.mount}
    stop = [
        f"ExecStopPost={program} stop" + (f" --state {word(str(state))}" if state else "")
        for state in sorted(states, key=str)
    ]
    writable = [f"ReadWritePaths={word(f'-{folder}', variables=False)}" for folder in sorted(folders(config, path))]
    return UNIT.format(
        user=user,
        group=_group(),
        program=program,
        config=word(str(path)),
        stop="\n".join(stop),
        writable="\n".join(writable),
    )


def folders(config: Config, path: Path) -> set[Path]:
    """Where the gateway must write, beside its StateDirectory: links of virtual ports and their locks, recordings."""
    found = {Path("/tmp")}
    for surface in config.surface:
        _, _, where = surface.at.partition("@")
        if where.startswith("pty:"):
            found.add(absolute(where.removeprefix("pty:"), path).parent)
    for mount in config.mount:
        found |= {absolute(mount.state, path)} if mount.state is not None else set()
        found |= {absolute(mount.record, path).parent} if mount.record is not None else set()
    return found


def absolute(name: str, path: Path) -> Path:
    """A path from a file, that means the same wherever the gateway is started. Raises UserError."""
    if not os.path.isabs(name):
        raise UserError(f"{path}: {name!r}: a service needs whole paths, that begin with /")
    return Path(name)


def word(text: str, variables: bool = True) -> str:
    """One word of a line of a unit, as systemd.service(5) wants it written. The program's name has no variables."""
    text = text.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%")
    text = text.replace("$", "$$") if variables else text
    return f'"{text}"' if set(text) & set(" \t'\"\\;") else text


def program() -> list[str]:
    """How this program was started, as words that start it from anywhere."""
    if in_one_file():
        return own_words()
    given, beside = sys.argv[0], str(Path(sys.executable).with_name("mount-gateway"))
    for name in (given, beside):
        found = shutil.which(name) if os.path.basename(name) == "mount-gateway" else None
        if found is not None:
            return [os.path.abspath(found)]  # not resolved: a link into a virtual environment says which one it is
    return own_words()


def _user() -> str:
    """Who asks; behind sudo, who really asks. Raises UserError for root, as whom nobody should run this."""
    import getpass

    try:
        user = os.environ.get("SUDO_USER") or getpass.getuser()
    except (KeyError, OSError):  # a number without a name, as in containers
        user = "root"
    if user == "root":
        raise UserError("service: as whom is it to run? write --user NAME; it needs the group dialout, not root")
    return user


def _is_user(name: str) -> bool:
    try:
        import pwd

        pwd.getpwnam(name)
    except (ImportError, KeyError):
        return name.isdecimal()
    return True


def _group() -> str:
    try:
        import grp
    except ImportError:
        raise UserError("service: there is no systemd on this system") from None

    there = {group.gr_name for group in grp.getgrall()}
    return next((name for name in GROUPS if name in there), GROUPS[0])
