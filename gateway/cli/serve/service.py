"""``service``: prints a systemd unit, the template ``mount-gateway.service`` filled in for this installation."""

from __future__ import annotations

import argparse
import os
import re
from pathlib import Path

from gateway.cli.command_line import Commands
from gateway.core.errors import UserError
from gateway.system.own_commands import gateway_argv

UNIT_TEMPLATE = Path(__file__).with_name("mount-gateway.service")

INSTALL_HELP = """\
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
        epilog=INSTALL_HELP,
    )  # fmt: skip
    default = Path("/etc/mount-gateway.toml")
    service.add_argument("file", nargs="?", type=Path, metavar="FILE", help="the same as --config FILE")
    service.add_argument("--config", type=Path, metavar="FILE", default=default, help=f"default {default}")
    about_user = "its user: the one whose programs use its virtual serial ports (default: you)"
    service.add_argument("--user", metavar="NAME", help=about_user)
    about_unit = "for a gateway beside others: the unit and its state folder are called mount-gateway-NAME"
    service.add_argument("--unit", metavar="NAME", default="", help=about_unit)
    service.set_defaults(run=_run_service)


def _run_service(arguments: argparse.Namespace) -> int:
    from gateway.app.config import make_config, read_tables
    from gateway.app.config.keys import NAME_PATTERN

    path = (arguments.file or arguments.config).absolute()
    if not path.exists():
        raise UserError(
            f"{path}: no such file; mount-gateway detect --network --write gateway.toml makes one here, "
            "and mount-gateway service --config gateway.toml takes it"
        )
    if any(mount.state for mount in make_config(*read_tables(path)).mount):
        raise UserError(f"{path}: take out the key state: a service keeps its state in a folder below /var/lib")
    if arguments.unit and not re.fullmatch(NAME_PATTERN, arguments.unit):
        raise UserError(f"service: --unit {arguments.unit!r}: write a word of letters, digits and _ . -")
    folder = "-".join(filter(None, ("mount-gateway", arguments.unit)))
    print(unit_text(gateway_argv(), str(path), *_user_and_group(arguments.user), folder), end="")
    return 0


def unit_text(program: list[str], config: str, user: str, group: str, folder: str) -> str:
    """Return the unit that runs a program with a configuration file; its state is in ``folder`` below /var/lib."""
    first, *more = (escape_word(part) for part in program)
    program = [first.replace("$$", "$"), *more]  # in the name of the program $ is not escaped
    return UNIT_TEMPLATE.read_text("utf-8").format(
        program=" ".join(program), config=escape_word(config), user=user, group=group, folder=folder
    )


def escape_word(text: str) -> str:
    """Escape a word of a command line in a unit, as systemd.service(5) requires."""
    text = text.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%").replace("$", "$$")
    return f'"{text}"' if set(text) & set(" \t'\"\\;") else text


def _user_and_group(login: str | None) -> tuple[str, str]:
    """Return the user of the unit (``login``, or the caller, also through sudo), and the group that opens serial ports.

    Raises UserError for a user who does not exist, for root unless ``login`` is root, and on a system without ``pwd``.
    """
    try:
        import grp
        import pwd
    except ImportError:
        raise UserError("service: this system has no systemd") from None
    user = login or os.environ.get("SUDO_USER") or str(os.getuid())
    try:
        user = (pwd.getpwuid(int(user)) if user.isdecimal() else pwd.getpwnam(user)).pw_name
    except KeyError:
        raise UserError(f"service: this computer has no user {user!r}; systemd would not start it") from None
    if user == "root" != login:
        raise UserError("service: which user runs it? Write --user NAME; that user needs the group dialout, not root")
    names = {group.gr_name for group in grp.getgrall()}
    return user, "uucp" if "dialout" not in names and "uucp" in names else "dialout"
