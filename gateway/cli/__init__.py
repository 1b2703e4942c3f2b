"""The command line: its parser, and the commands.

One line per open endpoint goes to stdout; a mistake is one line on stderr and exit code 2.
"""

from __future__ import annotations

import argparse
import re
import sys

from gateway.cli import suggestions
from gateway.cli.command_line import COMMANDS, commands_of, parser
from gateway.core.errors import UserError
from gateway.system import garbage, streams

#: What may stand in the place of a command.
ABOUT = ("-h", "--help", "--version")
#: Flags that mean all of something when nothing is behind them.
ALONE = ("--log", "--read-only")
#: Those that take a place on the sky.
POINTING = ("goto", "sync")
#: Of a message, in characters: three lines of a terminal, paths included.
LONGEST = 500


def main(argv: list[str] | None = None) -> int:
    """Run a command -> its exit code: 0 done, 1 not (nothing found, a mount that could not be stopped), 2 bad input.

    What was to be told on stdout and cannot be is bad input, too; a reader that has had enough is none.
    """
    garbage.starting()
    streams.take_up()
    code = 0
    try:
        words = _bound(sys.argv[1:] if argv is None else argv)
        arguments = _parsed(words)
        code = int(arguments.run(arguments) or 0)
    except UserError as error:
        streams.warn(_shortened(str(error)), streams.ERROR)
        code = 2
    except KeyboardInterrupt:
        code = 0
    except SystemExit:  # the help was asked for
        if (failed := streams.flush()) is None:
            raise
        return _untold(failed, code)
    except OSError as error:
        failed = streams.flush() or (error if streams.of_writing(error) else None)
        if failed is None:
            raise
        return _untold(failed, code)
    failed = streams.flush()
    return code if failed is None else _untold(failed, code)


def _parsed(words: list[str]) -> argparse.Namespace:
    """The words as a command and its arguments. Raises UserError, and SystemExit where help was asked for."""
    if not words:
        raise UserError("which command? mount-gateway demo needs no mount; mount-gateway --help lists all of them")
    words = suggestions.page(words)
    if words[0] not in (*COMMANDS, *ABOUT):
        raise suggestions.command(words[0], list(COMMANDS))
    arguments, left = parser(words[:1]).parse_known_args(words)
    if left:
        every = commands_of(parser())
        raise suggestions.extra(left, every[words[0]], [one for name, one in every.items() if name != words[0]])
    return arguments


def _untold(failed: Exception, code: int) -> int:
    """The exit code when stdout could not be written to."""
    if isinstance(failed, BrokenPipeError):
        return code
    streams.warn(f"cannot write to stdout: {streams.reason(failed)}", streams.ERROR)
    return 2


def _shortened(text: str) -> str:
    """A message in which somebody's thousand digits are left out."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}"


def _bound(argv: list[str]) -> list[str]:
    """``--site -33.9,151.2`` as ``--site=-33.9,151.2``: else a value that begins with a minus is taken for a flag.

    A declination behind a blank is no flag either: ``goto 05:35:17 -05:23:28``.

    ``--log`` and ``--read-only`` stand alone, whatever follows: what they may be followed by is written with an
    equals sign.
    """
    bound: list[str] = []
    for word in argv:
        word = f"{word}=all" if word in ALONE else word
        if bound and re.fullmatch(r"--[a-z-]+", bound[-1]) and re.match(r"-[\d.]", word):
            bound[-1] += f"={word}"
        elif bound and bound[0] in POINTING and re.match(r"-[\d.]", word):
            bound.append(f" {word}")
        else:
            bound.append(word)
    return bound
