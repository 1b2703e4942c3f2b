"""``service``: prints a systemd unit that fits this installation and its configuration.

The unit has a normal user, not a dynamic one: a virtual serial port belongs to the user who opens it, and a dynamic
user has a /tmp of its own, so that no program would see /tmp/lx200. The kernel follows a link in /tmp only for its
owner, so the default is the user who runs the programs. The unit denies access to the rest of the system as far as
serial ports allow: ``PrivateDevices`` and ``ProtectClock`` would hide the ports, ``PrivateTmp`` the links.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.command_line import Commands
from gateway.core.errors import UserError
from gateway.system import streams
from gateway.system.own_commands import gateway_argv, is_single_file

if TYPE_CHECKING:
    from gateway.app.config import Config

DEFAULT = Path("/etc/mount-gateway.toml")
#: What the unit is called, and what its name begins with if there are several.
UNIT_NAME = "mount-gateway"
#: The groups that may open serial ports: on Debian and most others, and on Arch.
GROUPS = ("dialout", "uucp")

UNIT = """\
# /etc/systemd/system/{name}.service, made by mount-gateway service
[Unit]
Description=Gateway between LX200 and NexStar programs and mounts ({name})
After=network.target
# Give up after some restarts: a wrong configuration stays wrong, but a network address may only be missing at first.
StartLimitIntervalSec=300
StartLimitBurst=20

[Service]
Type=notify
User={user}
SupplementaryGroups={group}
ExecStart={program} run --wait --config {config}
# However the gateway ended, the mount is stopped.
{stop}
StateDirectory={name}
CacheDirectory=mount-gateway
SyslogIdentifier={name}
# If the gateway hangs, systemd ends it, the mount is stopped, and the gateway is started again.
WatchdogSec=20
Restart=on-failure
RestartSec=5
# A start translates a site that is written in minutes; on a small computer that takes up to two minutes, once.
TimeoutStartSec=150
# Before it ends, the gateway stops motion and resumes tracking; a hand control answers within seconds.
TimeoutStopSec=30

# No access except to serial ports and the links of virtual ones in /tmp.
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
Examples:
  mount-gateway detect --network --write gateway.toml
  mount-gateway service --config gateway.toml | sudo tee /etc/systemd/system/mount-gateway.service
  sudo systemctl enable --now mount-gateway
  systemctl status mount-gateway        how the mount is
  journalctl -u mount-gateway -f        what is going on
  mount-gateway service --config /etc/mount-gateway-east.toml --unit east
      a second one, mount-gateway-east, for another mount
"""


def add_service(commands: Commands) -> None:
    service = commands.add_parser(
        "service",
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
    service.add_argument(
        "--unit",
        metavar="NAME",
        default="",
        help="for a gateway of its own beside others: the unit and its state folder are called mount-gateway-NAME",
    )
    service.set_defaults(run=_service)


def _service(arguments: argparse.Namespace) -> int:
    from gateway.app.config import make_config, read_tables
    from gateway.app.config.keys import WORD

    path = (arguments.file or arguments.config).absolute()
    if not os.path.lexists(path):
        raise UserError(
            f"{path}: no such file; mount-gateway detect --network --write gateway.toml makes one here, "
            "and mount-gateway service --config gateway.toml takes it"
        )
    config = make_config(*read_tables(path))
    if arguments.user and not _is_user(arguments.user):
        raise UserError(f"service: this computer has no user {arguments.user!r}; systemd would not start it")
    if arguments.unit and not re.fullmatch(WORD, arguments.unit):
        raise UserError(f"service: --unit {arguments.unit!r}: write a word of letters, digits and _ . -")
    name = "-".join(filter(None, (UNIT_NAME, arguments.unit)))
    print(unit(config, path, arguments.user or _user(), program(), name), end="")
    if not any(reached_from_elsewhere(surface.at) for surface in config.surface):
        streams.warn(
            f"only programs on this computer will reach this gateway, no phone: {path} has no surface at "
            "tcp://0.0.0.0:4030",
            streams.INFO,
        )
    return 0


def reached_from_elsewhere(at: str) -> bool:
    """Whether other computers reach a surface: it is on the network, or on a real serial port."""
    from gateway.transport.tcp import exposed

    where = at.partition("@")[2]
    return not where.startswith("pty:") and (exposed(where) or "://" not in where)


def unit(config: Config, path: Path, user: str, run: list[str], name: str = UNIT_NAME) -> str:
    """Return the unit ``name`` for the program ``run`` with the configuration file at ``path``. Raises UserError."""
    program = " ".join([word(run[0], variables=False), *map(word, run[1:])])
    states = {None if mount.state is None else absolute(mount.state, path) for mount in config.mount}
    stop = [
        f"ExecStopPost={program} stop" + (f" --state {word(str(state))}" if state else "")
        for state in sorted(states, key=str)
    ]
    writable = [f"ReadWritePaths={word(f'-{folder}', variables=False)}" for folder in sorted(folders(config, path))]
    return UNIT.format(
        name=name,
        user=user,
        group=_group(),
        program=program,
        config=word(str(path)),
        stop="\n".join(stop),
        writable="\n".join(writable),
    )


def folders(config: Config, path: Path) -> set[Path]:
    """Return where the gateway writes besides its StateDirectory: virtual ports and their locks, recordings."""
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
    """Return an absolute path from a configuration file. Raises UserError for a relative one."""
    if not os.path.isabs(name):
        raise UserError(f"{path}: {name!r}: a service needs whole paths, that begin with /")
    return Path(name)


def word(text: str, variables: bool = True) -> str:
    """Escape one word of a line as systemd.service(5) requires; in the program's name ``$`` is not escaped."""
    text = text.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%")
    text = text.replace("$", "$$") if variables else text
    return f'"{text}"' if set(text) & set(" \t'\"\\;") else text


def program() -> list[str]:
    """Return the words that start this program from any folder."""
    if is_single_file():
        return gateway_argv()
    given, beside = sys.argv[0], str(Path(sys.executable).with_name("mount-gateway"))
    for name in (given, beside):
        found = shutil.which(name) if os.path.basename(name) == "mount-gateway" else None
        if found is not None:
            return [os.path.abspath(found)]  # not resolved: a link into a virtual environment says which one it is
    return gateway_argv()


def _user() -> str:
    """Return the user of this command, or the one who called sudo. Raises UserError for root."""
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
