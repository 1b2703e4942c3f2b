"""Messages for mistyped commands and flags: one line that says what is wrong and what was probably meant."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Mapping, Sequence

from gateway.core.errors import UserError, similar_words

#: Patterns of argparse's messages, and the message in plain words for each.
_PLAIN_MESSAGES = (
    (r"argument ([-\w/]+): invalid float value: ('.*')", r"{0} {1}: write a number"),
    (r"argument ([-\w/]+): invalid int value: ('.*')", r"{0} {1}: write a whole number"),
    (
        r"argument direction: invalid choice: '(up|down|left|right)'.*",
        "direction {0}: write one of north, south, east, west; on an alt-az mount north is up, south is down, and east "
        "and west turn it in azimuth",
    ),
    (r"argument (\S+): invalid choice: (?:'(?=\d+' ))?('.*'|\d+)'? \(choose from (.*)\)", r"{0} {1}: write one of {2}"),
    (r"argument (--[-\w]+): expected one argument", r"{0}: write its value after it"),
    (r"argument (--[-\w]+): not allowed with argument (--[-\w]+)", r"write {1} or {0}, not both"),
    (r"argument ([-\w/]+): ignored explicit argument ('.*')", r"{0} takes no value: leave {1} out"),
    (r"ambiguous option: (\S+) could match (.*)", r"{0} may mean {1}: write one of them in full"),
    (r"the following arguments are required: (.*)", r"missing: {0}"),
)

#: What a user may type instead of a command -> the command, with a flag if it needs one.
_COMMAND_BY_SYNONYM = {
    word: command
    for command, mistyped in {
        "run": "start serve connect",
        "detect": "scan find ports list",
        "goto": "slew point",
        "stop": "abort halt",
        "sim": "simulate simulator simulated",
        "status": "info position",
        "status --watch": "watch",
        "service": "install systemd",
        "run --log": "log",
        "run --record FILE": "record",
    }.items()
    for word in mistyped.split()
}
#: Words in place of a command that ask for help or the version.
_FLAG_BY_HELP_WORD = {
    "help": "--help",
    "-?": "--help",
    "/?": "--help",
    "version": "--version",
    "-v": "--version",
    "-V": "--version",
}


def with_help_flag(arguments: Sequence[str]) -> list[str]:
    """Turn ``help goto`` into ``goto --help`` and ``version`` into ``--version``; return other words unchanged."""
    flag = _FLAG_BY_HELP_WORD.get(arguments[0]) if arguments else None
    if flag == "--help":
        return [flag, *arguments[1:2]] if arguments[1:2] == ["all"] else [*arguments[1:2], flag]
    return list(arguments) if flag is None else [flag]


def unknown_command_error(word: str, commands: Mapping[str, argparse.ArgumentParser]) -> UserError:
    """Return the error for a first word that is no command; ``commands`` maps names of commands to their parsers."""
    if word.startswith("-"):
        flag = word.partition("=")[0]
        if (bare := flag.lstrip("-")) in commands:
            return UserError(f"there is no flag {flag}; did you mean mount-gateway {bare}?")
        has = next((name for name in ("run", *commands) if flag in _flags_of(commands[name])), "")
        right = f"write a command before it: mount-gateway {has} {word}" if has else "a command comes first"
        return UserError(f"{flag}: {right}; mount-gateway --help lists the commands")
    if word.endswith(".toml"):
        return UserError(f"{word!r} is not a command; did you mean mount-gateway run {word}?")
    if "@" in word:
        return UserError(f"{word!r} is not a command; did you mean mount-gateway run --mount {word}?")
    close = [*filter(None, [_COMMAND_BY_SYNONYM.get(word.lower())]), *similar_words(word.lower(), list(commands))]
    right = f"did you mean mount-gateway {close[0]}?" if close else f"the commands are {', '.join(commands)}"
    return UserError(f"there is no command {word!r}; {right}")


def plain_message(message: str, prog: str, example: str) -> str:
    """Return argparse's message in plain words, with an example if an argument is missing."""
    for pattern, ours in _PLAIN_MESSAGES:
        if match := re.fullmatch(pattern, message):
            parts = [part.replace("'", "") if number == 2 else part for number, part in enumerate(match.groups())]
            message = ours.format(*parts)
            if message.startswith("missing") and example:
                return f"{message}; for example: {example}"
            break
    return f"{message} ({prog} --help explains it)"


def first_example(epilog: str, prog: str) -> str:
    """Return the first example in the ``epilog`` of a command, without its remark; empty if it has none."""
    lines = (line.strip().partition("  ")[0] for line in epilog.splitlines() if line.startswith(f"  {prog} "))
    return next(lines, "")


def unexpected_words_error(
    arguments: Sequence[str], parser: argparse.ArgumentParser, other_parsers: Iterable[argparse.ArgumentParser]
) -> UserError:
    """Return the error for the first argument that a command does not take: an unknown flag or a superfluous word."""
    word = arguments[0].partition("=")[0]
    name = parser.prog.rpartition(" ")[2]
    if not word.startswith("-"):
        if "@" in word and "--mount" in _flags_of(parser):
            return UserError(f"{word}: write --mount before the mount, and --surface before where programs connect")
        return UserError(f"{word!r}: {name} does not take it ({parser.prog} --help explains it)")
    flags = sorted(flag for flag in _flags_of(parser) if flag.startswith("--"))
    right = f"{parser.prog} --help lists them"
    if has := [other.prog for other in other_parsers if word in _flags_of(other)]:
        right = f"{' and '.join(has[:2])} {'has' if len(has) == 1 else 'have'} it"
    elif key := _key_hint(word):
        right = key
    elif close := similar_words(word, flags, min_similarity=0.75):
        right = f"did you mean {close[0]}?"
    return UserError(f"{name} has no flag {word}; {right}")


def _flags_of(parser: argparse.ArgumentParser) -> set[str]:
    return {flag for action in parser._actions for flag in action.option_strings}


def _key_hint(flag: str) -> str:
    """Return the hint that a mistyped flag is a key of gateway.toml; empty if there is no such key."""
    from gateway.app.config.describing import find_key, header_of

    table = next((table for table in ("mount", "surface", "console") if find_key(table, flag[2:])), "")
    where = f"{flag[2:]} is written in gateway.toml, under {header_of(table)}; mount-gateway config --example shows how"
    return where if table else ""
