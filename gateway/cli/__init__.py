"""The command line: its parser, and the commands.

Results go to stdout; a user's mistake is reported in one line on stderr, with exit code 2.
"""

from __future__ import annotations

import argparse
import os
import re
import sys

from gateway.cli import suggestions
from gateway.cli.command_line import COMMANDS, find_parsers, make_parser
from gateway.core.errors import UserError, explain_os_error
from gateway.system import garbage, streams

#: Flags that may be given without a command.
INFORMATION_FLAGS = ("-h", "--help", "--version")
_LOG_FILTERS = ("program", "mount", "changes", "refusals")
LOG_VALUES = ("all", "true", "false", *_LOG_FILTERS, "json", *(f"json-{side}" for side in _LOG_FILTERS))
#: For each flag that may be given without a value: the values that it may have, and the value that it has without one.
CHOICES_BY_BARE_FLAG = {"--log": LOG_VALUES, "--read-only": ("all", "true")}
DEFAULT_BY_BARE_FLAG = {"--log": "true", "--read-only": "all"}
#: Commands that take a position on the sky.
POSITION_COMMANDS = ("goto", "sync")
#: Maximum length of a message in characters: three lines of a terminal, paths included.
MAX_MESSAGE = 500


def main(argv: list[str] | None = None) -> int:
    """Run a command and return its exit code: 0 done, 1 not done (no mount found, a mount not stopped), 2 bad input.

    If stdout cannot be written, the code is 2, except if its reader closed the pipe. Raises SystemExit after help.
    """
    garbage.collect_rarely()
    streams.reopen_closed_streams()
    streams.set_encoding_fallback()
    code = 0
    try:
        typed = _escape_for_argparse(sys.argv[1:] if argv is None else argv)
        arguments = _parse(typed)
        code = int(arguments.run(arguments) or 0)
    except UserError as error:
        text = str(error)  # a user may have typed a thousand digits
        short = text if len(text) <= MAX_MESSAGE else f"{text[: MAX_MESSAGE // 2]} ... {text[-MAX_MESSAGE // 2 :]}"
        streams.warn(short, streams.ERROR)
        code = error.exit_code
    except KeyboardInterrupt:
        code = 0
    except SystemExit:  # argparse has printed the help
        if (failed := streams.flush_stdout()) is None:
            raise
        return _report_stdout_error(failed, code)
    except OSError as error:
        failed = streams.flush_stdout() or (error if streams.is_write_error(error) else None)
        if failed is None:
            raise
        return _report_stdout_error(failed, code)
    failed = streams.flush_stdout()
    return code if failed is None else _report_stdout_error(failed, code)


def _parse(typed_words: list[str]) -> argparse.Namespace:
    """Parse the words of the command line. Raises UserError, and SystemExit after printing help."""
    if not typed_words:
        raise UserError("which command? mount-gateway demo needs no mount; mount-gateway --help lists all of them")
    typed_words = suggestions.with_help_flag(typed_words)
    if typed_words[0] not in (*COMMANDS, *INFORMATION_FLAGS):
        raise suggestions.unknown_command_error(typed_words[0], find_parsers(make_parser()))
    arguments, left = make_parser(typed_words[:1]).parse_known_args(typed_words)
    if left:
        every = find_parsers(make_parser())
        raise suggestions.unexpected_words_error(
            left, every[typed_words[0]], [other for name, other in every.items() if name != typed_words[0]]
        )
    return arguments


def _report_stdout_error(error: Exception, exit_code: int) -> int:
    """Report that stdout cannot be written, and return 2. If its reader closed the pipe, only return ``exit_code``."""
    if isinstance(error, BrokenPipeError):
        return exit_code
    why = explain_os_error(error) if isinstance(error, OSError) else str(error)
    streams.warn(f"cannot write to stdout: {why}", streams.ERROR)
    return 2


def _escape_for_argparse(argv: list[str]) -> list[str]:
    """Rewrite words that argparse would misunderstand.

    ``--site -33.9,151.2`` becomes ``--site=-33.9,151.2``, because argparse takes a value with a minus for a flag. A
    negative declination gets a blank before it: ``goto 05:35:17 -05:23:28``. ``--log`` and ``--read-only`` become
    ``--log=true`` and ``--read-only=all``, and ``--log changes`` becomes ``--log=changes``. Raises UserError if the
    word after ``--log`` is neither a value of it nor an existing file: it is probably a misspelt value.
    """
    rewritten: list[str] = []
    alone = ""
    for word in argv:
        if word in CHOICES_BY_BARE_FLAG.get(alone, ()):
            rewritten[-1], alone = f"{alone}={word}", ""
            continue
        if alone == "--log" and re.fullmatch(r"\w[\w-]*", word) and not os.path.exists(word):
            raise UserError(f"--log has no {word!r}; write one of {', '.join(LOG_VALUES)}")
        alone = word if word in CHOICES_BY_BARE_FLAG else ""
        word = f"{word}={DEFAULT_BY_BARE_FLAG[word]}" if alone else word
        if rewritten and re.fullmatch(r"--[a-z-]+", rewritten[-1]) and re.match(r"-[\d.]", word):
            rewritten[-1] += f"={word}"
        elif rewritten and rewritten[0] in POSITION_COMMANDS and re.match(r"-[\d.]", word):
            rewritten.append(f" {word}")
        else:
            rewritten.append(word)
    return rewritten
