"""The parser of the command line: the list of all commands, the layout of help, and the report of mistakes.

``add_NAME`` of a command's module adds the command to the parser, and the rest of the module carries it out. Only the
module of the command that was typed is loaded, so that a gateway starts soon after power-on. For the same reason an
epilog with the list of models is made only when the user asks for help.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from importlib import import_module
from itertools import groupby
from typing import Any, NoReturn, TypeAlias

from gateway.cli.suggestions import first_example, plain_message
from gateway.core.about import full_version
from gateway.core.errors import UserError

#: The flags for help.
HELP_FLAGS = ("-h", "--help")
#: The word after ``--help`` that asks for all of it: every command or flag, models and exit codes.
ALL_HELP_WORD = "all"
EXIT_CODES_HELP = """\
Exit codes:
  0  done
  1  no: detect found no mount, doctor found a problem, stop could not stop a mount, the command of explain is not \
valid; no gateway runs, or it refused (status, goto, sync, move, park, unpark)
  2  not tried: a mistake in the command or in gateway.toml, a port in use, no mount that answers; one line on stderr \
says what is wrong and where
"""

ENDPOINTS_HELP = """\
PROTOCOL@WHERE, in full PROTOCOL[:MODEL[/VERSION]]@WHERE, names a mount, or a surface: the place where programs connect.
The gateway asks a mount for its model, and presents one that fits to programs.
  PROTOCOL  of a mount: lx200 (Meade, OnStep, TeenAstro), nexstar (Celestron, Sky-Watcher), alpaca (any ASCOM Alpaca \
telescope)
            of a surface: these, stellarium, or any (tcp:// only), which recognises programs and browsers by their \
first bytes
  VERSION   of the hand control, like 4.21
  WHERE     of a mount: /dev/ttyUSB0, COM3, socket://HOST:PORT, rfc2217://HOST:PORT, http://HOST:PORT (alpaca), \
or sim (a simulated mount)
            of a surface: tcp://HOST:PORT, pty:PATH (a virtual serial port), /dev/ttyS0, COM5, rfc2217://HOST:PORT \
(for drivers that redirect a COM port to the network)
"""
#: The subparsers object of argparse, to which each command adds its own parser.
Commands: TypeAlias = "argparse._SubParsersAction[Parser]"


#: A row of an epilog: its first column (a word, or a command), a gap of blanks, and its second column (the meaning).
_EPILOG_ROW = r"( +\S.*?)( {2,})(\S.*)"


def _wrap_row(line: str, width: int) -> list[str]:
    """Wrap a row of an epilog: its second column stays aligned, and a wrapped command can be pasted into a shell."""
    if len(line) <= width:
        return [line]
    indent, row = " " * (len(line) - len(line.lstrip())), re.fullmatch(_EPILOG_ROW, line)
    first, gap, second = row.groups() if row else (line, "", "")
    if first.startswith("  mount-gateway "):
        below = indent + "    "
        joined = re.sub(r"( --[a-z-]+) (?=[^-])", "\\1\0", first)  # a flag stays with its value
        command = [part.replace("\0", " ") for part in _wrap_text(joined, width - 2, "", below + "    ")]
        lines = [f"{part} \\" for part in command[:-1]] + command[-1:]
        return lines + (_wrap_text(second, width, below, below) if second else [])
    return _wrap_text(
        second or line.strip(), width, first + gap if second else indent, " " * len(first + gap) if second else indent
    )


def _wrap_text(text: str, width: int, first: str, others: str) -> list[str]:
    import textwrap  # help alone needs it

    return textwrap.wrap(
        text, width, initial_indent=first, subsequent_indent=others, break_long_words=False, break_on_hyphens=False
    )


class HelpLayout(argparse.HelpFormatter):
    """Lays out descriptions and epilogs: a line that begins with a blank is a row of its own."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        filled: list[str] = []
        for are_rows, group in groupby(text.splitlines(), lambda line: line[:1] in ("", " ")):
            lines = list(group)
            filled += (
                [part for line in lines for part in _wrap_row(line, width)]
                if are_rows
                else _wrap_text(" ".join(lines), width, "", "")
            )
        return "\n".join(indent + line for line in filled)


class _HelpAction(argparse.Action):
    """The action of ``--help``: prints the short help, or with ``--help all`` the whole help."""

    def __call__(self, parser: argparse.ArgumentParser, _: object, word: Any, __: str | None = None) -> None:
        assert isinstance(parser, Parser)
        parser.shows_all = word == ALL_HELP_WORD
        parser.print_help()
        parser.exit()


class Parser(argparse.ArgumentParser):
    """A parser that reports a mistake in one line.

    When the user asks for help, ``make_epilog`` makes the text below the flags, and ``more_help`` the text that
    ``--help all`` adds. Flags in ``hidden_actions`` are shown only by ``--help all``. Flags in ``suppressed_actions``
    are never shown, because the help of another command explains them.
    """

    def __init__(
        self, *, make_epilog: Callable[[], str] | None = None, more_help: Callable[[], str] | None = None, **kwargs: Any
    ) -> None:
        self._width: int | None = 80  # argparse lays out every flag once, and nobody sees it
        super().__init__(add_help=False, **kwargs)
        self._make_epilog, self._more_help = make_epilog, more_help
        self.shows_all = False
        self.hidden_actions: Sequence[argparse.Action] = ()
        self.suppressed_actions: Sequence[argparse.Action] = ()
        self.add_argument(*HELP_FLAGS, action=_HelpAction, nargs="?", help=argparse.SUPPRESS)

    def format_help(self) -> str:
        """Return the help; if ``shows_all``, with the hidden flags and the additional text."""
        more = self._more_help() if self.shows_all and self._more_help is not None else ""
        self.epilog, self._width = f"{self._epilog_text()}\n{more}", None
        left_out = [*self.suppressed_actions, *([] if self.shows_all else self.hidden_actions)]
        helps = [action.help for action in left_out]
        for action in left_out:
            action.help = argparse.SUPPRESS
        try:
            return super().format_help()
        finally:
            for action, help_text in zip(left_out, helps, strict=True):
                action.help = help_text

    def _get_formatter(self) -> argparse.HelpFormatter:
        """Return the formatter of help. The terminal's width is looked up, in 4 ms, only for help that is shown."""
        return HelpLayout(self.prog, width=self._width)

    def error(self, message: str) -> NoReturn:
        raise UserError(plain_message(message, self.prog, first_example(self._epilog_text(), self.prog)))

    def _get_option_tuples(self, option_string: str) -> Any:
        """Return the flags that a word abbreviates. ``--name`` does not abbreviate ``--names``: it is another key."""
        return [] if option_string.partition("=")[0] == "--name" else super()._get_option_tuples(option_string)

    def _epilog_text(self) -> str:
        return self._make_epilog() if self._make_epilog is not None else self.epilog or ""


def endpoints_help() -> str:
    """Return the help on endpoints (``PROTOCOL@WHERE``), with the list of all models."""
    from gateway.core.tables import mappings_folder, read_table

    lines = [ENDPOINTS_HELP + "models:"]
    for models in sorted(mappings_folder().glob("*/models.toml")):
        protocol = models.parent.name
        lines.append(f"  {protocol:<9} {' '.join(read_table(f'{protocol}/models.toml'))}")
    return "\n".join(lines)


#: Group -> command -> its module and its line in ``--help``, in the order of ``--help``.
COMMAND_GROUPS = {
    "Commands:": {
        "demo": ("serve.demo", "try it without a mount, in a browser"),
        "detect": ("inspect.detect", "find the mount, and print the command that starts the gateway"),
        "run": ("serve.run", "start the gateway, which connects programs to a mount"),
        "status": ("mount.status", "where the mount points, who is connected, what was refused"),
        "goto": ("mount.requests", "point the mount: goto M42, goto 05:34:32 +22:00:52"),
        "sync": ("mount.requests", "tell the mount which object it points at"),
        "move": ("mount.requests", "move the mount north, south, east or west for some seconds"),
        "park": ("mount.requests", "send the mount to its park position"),
        "unpark": ("mount.requests", "let a parked mount track again"),
        "stop": ("mount.stop", "stop every mount"),
    },
    "When it does not work, and to set it up:": {
        "doctor": ("inspect.doctor", "find what on this computer is in the way, and what to do"),
        "prove": ("inspect.prove", "check your own mount in nine minutes"),
        "config": ("serve.run", "show the configuration in effect, or an example of gateway.toml"),
        "service": ("serve.service", "print a systemd unit that starts the gateway at boot"),
    },
    "More commands:": {
        "fleet": ("fleet", "show all mounts of an MQTT broker on a page, with STOP for all of them"),
        "sim": ("serve.sim", "simulate a mount for other programs"),
        "explain": ("inspect.explain", "show what the gateway does with one command, in words and bytes"),
        "almanac": ("inspect.almanac", "calculate the sky for a computer without astropy"),
        "decode": ("inspect.recordings", "show a recording, or a capture of a serial line, in words"),
        "report": ("inspect.recordings", "make a page with plots of a recording"),
        "completion": ("completion", "print a script that completes commands and flags in your shell"),
    },
}
COMMANDS = {name: command for group in COMMAND_GROUPS.values() for name, command in group.items()}

PROGRAM_SUMMARY = """\
Lets Meade LX200 software drive a Celestron NexStar mount, and the reverse.
"""
HELP_EPILOG = """\
Start without a mount: mount-gateway demo. Start with one: mount-gateway detect prints the command for yours, such as
  mount-gateway run --mount nexstar@/dev/ttyUSB0 --surface lx200@tcp://127.0.0.1:4030

mount-gateway COMMAND --help explains one command. mount-gateway --help all lists the other commands, the models and \
the exit codes.
"""


def group_help(group: str) -> str:
    """Return the help text of a group of commands: its title, and a line for each command."""
    rows = [f"  {name:<11} {summary}" for name, (_, summary) in COMMAND_GROUPS[group].items()]
    return "\n".join([group, *rows, ""])


class _VersionAction(argparse.Action):
    """The action of ``--version``: looks up the version and prints it."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(f"mount-gateway {full_version()}")
        parser.exit()


class _CommandsAction(argparse._SubParsersAction):  # type: ignore[type-arg]
    """The commands of the parser. Each gets its line of ``COMMAND_GROUPS`` as its help, for the menus of shells."""

    def add_parser(self, name: str, **parser_options: Any) -> Any:
        return super().add_parser(name, help=COMMANDS[name][1], **parser_options)


def make_parser(argv: Sequence[str] = ()) -> Parser:
    """Make the parser of the commands in ``argv`` (none: of all), without flags if ``argv`` begins with a help flag."""
    *shown, hidden = COMMAND_GROUPS
    whole = Parser(
        prog="mount-gateway",
        usage="mount-gateway COMMAND [options]",
        description=PROGRAM_SUMMARY,
        make_epilog=lambda: "\n".join([*map(group_help, shown), HELP_EPILOG]),
        more_help=lambda: f"{group_help(hidden)}\n{endpoints_help()}\n\n{EXIT_CODES_HELP}",
    )
    whole.add_argument("--version", action=_VersionAction, nargs=0, help="print the version and the commit, and exit")
    commands = whole.add_subparsers(
        prog=whole.prog, required=True, metavar="COMMAND", action=_CommandsAction, help=argparse.SUPPRESS
    )
    for name in [name for name in COMMANDS if name in argv] or COMMANDS:
        if argv and argv[0] in HELP_FLAGS:
            commands.add_parser(name)
        else:
            getattr(import_module(f"gateway.cli.{COMMANDS[name][0]}"), f"add_{name}")(commands)
    return whole


def find_parsers(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Return the parsers of all commands by name."""
    [choices] = [action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    return dict(choices)
