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

from gateway.cli.suggestions import example, plainly
from gateway.core.about import full_version
from gateway.core.errors import UserError

#: The flags for help.
HELP = ("-h", "--help")
EXIT_CODES = """\
Exit codes:
  0  done
  1  the answer is no: no mount was found (detect); something is to be mended (doctor); a mount could not be stopped \
(stop); no gateway runs, or it refused (status, watch, goto, sync, move, park, unpark); the bytes differ from the \
recording (replay), or from the tables (tables --check); the command is not valid (explain)
  2  it could not be tried: a mistake in the command or in gateway.toml, a port in use, no mount that answers; one \
line on stderr says what is wrong and where
"""

WHERE = """\
PROTOCOL@WHERE, in full PROTOCOL[:MODEL[/VERSION]]@WHERE, names a mount, or a surface: that is where programs connect.
Without a model a mount is asked what it is, and programs are presented one that fits.
  PROTOCOL  of a mount: lx200 (Meade, OnStep, TeenAstro), nexstar (Celestron, Sky-Watcher) or alpaca (any ASCOM \
Alpaca telescope)
            of a surface stellarium (Stellarium's own), too, and any (tcp:// only): every one of them and web \
browsers, told by what they say first
  VERSION   of the hand control, like 4.21
  WHERE     of a mount: /dev/ttyUSB0, COM3, socket://HOST:PORT, rfc2217://HOST:PORT, http://HOST:PORT (alpaca), \
or sim (a simulated one)
            of a surface: tcp://HOST:PORT, rfc2217://HOST:PORT (for drivers that make a COM port of it), pty:PATH (a \
virtual serial port), /dev/ttyS0, COM5
"""
#: The object of argparse to which a command adds its parser.
Commands: TypeAlias = "argparse._SubParsersAction[Parser]"


#: A line of an epilog that begins with a blank: a word and, after a gap, what it means; or a command and a remark.
_ROW = r"( +\S.*?)( {2,})(\S.*)"


def _row(line: str, width: int) -> list[str]:
    """Wrap a line that begins with a blank: its second column stays one, a command can be copied."""
    if len(line) <= width:
        return [line]
    indent, row = " " * (len(line) - len(line.lstrip())), re.fullmatch(_ROW, line)
    first, gap, rest = row.groups() if row else (line, "", "")
    if first.startswith("  mount-gateway "):
        below = indent + "    "
        joined = re.sub(r"( --[a-z-]+) (?=[^-])", "\\1\0", first)  # a flag stays with its value
        command = [part.replace("\0", " ") for part in _wrapped(joined, width - 2, "", below + "    ")]
        lines = [f"{part} \\" for part in command[:-1]] + command[-1:]
        return lines + (_wrapped(rest, width, below, below) if rest else [])
    return _wrapped(
        rest or line.strip(), width, first + gap if rest else indent, " " * len(first + gap) if rest else indent
    )


def _wrapped(text: str, width: int, first: str, others: str) -> list[str]:
    import textwrap  # help alone needs it

    return textwrap.wrap(
        text, width, initial_indent=first, subsequent_indent=others, break_long_words=False, break_on_hyphens=False
    )


class Layout(argparse.HelpFormatter):
    """Lays out descriptions and epilogs: a line that begins with a blank is a row of its own."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        filled: list[str] = []
        for kept, group in groupby(text.splitlines(), lambda line: line[:1] in ("", " ")):
            lines = list(group)
            filled += (
                [part for line in lines for part in _row(line, width)]
                if kept
                else _wrapped(" ".join(lines), width, "", "")
            )
        return "\n".join(indent + line for line in filled)


class Parser(argparse.ArgumentParser):
    """A parser that reports a mistake in one line. ``late`` makes the epilog when the user asks for help; ``elsewhere``
    are the flags that the help of another command lists.
    """

    def __init__(self, *, late: Callable[[], str] | None = None, **others: Any) -> None:
        self._width: int | None = 80  # argparse lays out every flag once, and nobody sees it
        super().__init__(**others)
        self._late = late
        self.elsewhere: Sequence[argparse.Action] = ()

    def format_help(self) -> str:
        """Return the help with its epilog."""
        self.epilog, self._width = self._text_below(), None
        helps = [action.help for action in self.elsewhere]
        for action in self.elsewhere:
            action.help = argparse.SUPPRESS
        try:
            return super().format_help()
        finally:
            for action, words in zip(self.elsewhere, helps, strict=True):
                action.help = words

    def _get_formatter(self) -> argparse.HelpFormatter:
        """Return what lays out help: as wide as the terminal, which takes modules of 4 ms to find out."""
        return Layout(self.prog, width=self._width)

    def error(self, message: str) -> NoReturn:
        raise UserError(plainly(message, self.prog, example(self._text_below(), self.prog)))

    def _get_option_tuples(self, option_string: str) -> Any:
        """Return the flags that a word abbreviates. ``--name``, a key that has no flag, does not mean ``--names``."""
        return [] if option_string.partition("=")[0] == "--name" else super()._get_option_tuples(option_string)

    def _text_below(self) -> str:
        return self._late() if self._late is not None else self.epilog or ""


def endpoints() -> str:
    """Return the help on endpoints, with the list of all models."""
    from gateway.core.tables import mappings_folder, read_table

    lines = [WHERE + "models:"]
    for models in sorted(mappings_folder().glob("*/models.toml")):
        protocol = models.parent.name
        lines.append(f"  {protocol:<9} {' '.join(read_table(f'{protocol}/models.toml'))}")
    return "\n".join(lines)


#: Every command, its module and what ``--help`` says of it, in the order of ``--help``.
COMMANDS = {
    "demo": ("serve.demo", "a simulated mount to play with, on TCP 4040 (any program), 4030 and a virtual serial port"),
    "detect": ("inspect.detect", "which mount is on which port, and how to start"),
    "doctor": ("inspect.doctor", "what of this computer could be in the way, and what to do"),
    "prove": ("inspect.prove", "compare your mount with what the gateway believes of it"),
    "run": ("serve.run", "connect programs to a mount, or to several"),
    "status": ("mount.status", "where the mount points, what it does, for whom, and within which limits"),
    "watch": ("mount.status", "tell every second how the mount is, until Ctrl-C"),
    "goto": ("mount.requests", "point the mount to a place or an object, through the gateway that runs"),
    "sync": ("mount.requests", "tell the mount that it points to a place or an object now"),
    "move": ("mount.requests", "move the mount north, south, east or west for some seconds"),
    "park": ("mount.requests", "send the mount to its park position"),
    "unpark": ("mount.requests", "take a parked mount up again: it tracks"),
    "stop": ("mount.stop", "stop the mount: of every running gateway, and of one that was killed"),
    "fleet": ("fleet", "a page with all mounts on an MQTT broker, and STOP for all of them"),
    "config": ("serve.run", "the configuration in effect, or an example of gateway.toml"),
    "service": ("serve.service", "a systemd unit that starts the gateway with the computer"),
    "sim": ("serve.sim", "a simulated mount for other programs"),
    "tables": ("inspect.tables", "what becomes of every command, per model"),
    "explain": ("inspect.tables", "what happens to one command, in words and bytes"),
    "almanac": ("inspect.almanac", "calculate where Sun, Moon and planets are, for a computer without astropy"),
    "replay": ("inspect.recordings", "play a recording of run --record again and compare"),
    "decode": ("inspect.recordings", "a recording or a capture of a serial line, in words"),
    "report": ("inspect.recordings", "a recording as a page with plots"),
    "completion": ("completion", "a script that completes commands and flags in your shell"),
}

FIRST = """\
Lets Meade LX200 software drive a Celestron NexStar mount, and the reverse.
Software of both kinds can drive Sky-Watcher (SynScan), OnStep, TeenAstro and ASCOM Alpaca mounts, too.

First steps:
  mount-gateway demo
      without a mount: simulates one, and prints where your program can connect
  mount-gateway detect
      with a mount: finds its port, and prints the command that starts the gateway
  mount-gateway run --mount nexstar@/dev/ttyUSB0 --surface lx200@tcp://127.0.0.1:4030
      starts it: your program connects to port 4030 as if to a Meade
  mount-gateway goto Polaris
      while it runs, from another terminal: moves the mount without any program

mount-gateway COMMAND --help tells more, with examples.
"""


class _Version(argparse.Action):
    """Prints the version, which is looked up only then."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(f"mount-gateway {full_version()}")
        parser.exit()


class _Commands(argparse._SubParsersAction):  # type: ignore[type-arg]
    """Commands, each with its help in the list of all."""

    def add_parser(self, name: str, **others: Any) -> Any:
        return super().add_parser(name, help=COMMANDS[name][1], **others)


def parser(asked: Sequence[str] = ()) -> Parser:
    """Return the parser of the whole command line, or with only the commands in ``asked``; for help without theirs."""
    whole = Parser(prog="mount-gateway", description=FIRST, late=lambda: f"{endpoints()}\n\n{EXIT_CODES}")
    whole.add_argument("--version", action=_Version, nargs=0, help="print the version and the commit, and exit")
    commands = whole.add_subparsers(
        prog=whole.prog, title="commands", required=True, metavar="COMMAND", action=_Commands
    )
    for name in [name for name in COMMANDS if name in asked] or COMMANDS:
        if asked and asked[0] in HELP:
            commands.add_parser(name)
        else:
            getattr(import_module(f"gateway.cli.{COMMANDS[name][0]}"), f"add_{name}")(commands)
    return whole


def commands_of(whole: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Return the parsers of all commands by name."""
    [choices] = [action.choices for action in whole._actions if isinstance(action, argparse._SubParsersAction)]
    return dict(choices)
