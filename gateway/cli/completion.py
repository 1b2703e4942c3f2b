"""``completion``: a script that lets a shell complete the commands and flags.

The package shtab makes the script from the parser. The script is static: pressing TAB does not start Python, which
takes a second on a small computer.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from gateway.cli.command_line import COMMANDS, Commands, make_parser
from gateway.core.errors import UserError

SHELLS = ("bash", "zsh", "fish")

INSTALL_HELP = """\
Examples:
  mount-gateway completion bash | less      to look at it

To use it, once, as yourself, with bash:
  mkdir -p ~/.local/share/bash-completion/completions
  mount-gateway completion bash > ~/.local/share/bash-completion/completions/mount-gateway

with zsh, and in ~/.zshrc, before compinit, fpath=(~/.zfunc $fpath):
  mkdir -p ~/.zfunc
  mount-gateway completion zsh > ~/.zfunc/_mount-gateway

with fish:
  mount-gateway completion fish > ~/.config/fish/completions/mount-gateway.fish
"""


def add_completion(commands: Commands) -> None:
    completion = commands.add_parser(
        "completion",
        description="Prints a script with which your shell completes commands and flags when you press TAB.",
        epilog=INSTALL_HELP,
    )
    completion.add_argument("shell", choices=SHELLS, help="your shell")
    completion.set_defaults(run=lambda arguments: print(completion_script(arguments.shell)))


def completion_script(shell: str) -> str:
    """Return the completion script of a shell. Raises UserError if shtab is not installed."""
    try:
        import shtab
    except ImportError:
        raise UserError("completion: the package shtab is missing; pip install shtab") from None
    from gateway.app.config.describing import keys_of
    from gateway.app.control.objects import BODIES
    from gateway.astro.catalog.names import HIP_IDS
    from gateway.diagnostics.command_outcomes import model_versions
    from gateway.protocols.registry import PROTOCOLS, usual_ports
    from gateway.protocols.wireformat.command_set import load

    whole = make_parser()
    _set_short_descriptions(whole)
    choices_by_flag = {f"--{key.name}": key.choices for key in keys_of("mount") if key.choices}
    for action in _all_actions(whole):
        if action.metavar == "FILE":
            action.complete = shtab.FILE  # type: ignore[attr-defined]
        elif action.metavar == "PATH":
            action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
        elif "--surface" in action.option_strings:
            action.choices = [f"{name}@tcp://127.0.0.1:{port}" for name, port in usual_ports().items()]
        elif action.dest == "place":
            action.choices = [name for name in (*BODIES, *HIP_IDS) if name.isalpha()]
        elif action.dest == "mount" and not action.option_strings:
            action.choices = [
                f"{name}/{version}" if version else name
                for protocol in PROTOCOLS
                for name, version, _ in model_versions(load(protocol))
            ]
        elif choices := choices_by_flag.get(action.option_strings[0] if action.option_strings else ""):
            action.choices = choices
    return str(shtab.complete(whole, shell))


def _all_actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield every flag and argument of every command."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _all_actions(command)


def _set_short_descriptions(parser: argparse.ArgumentParser) -> None:
    """Set the short help of each command as its description, because menus of shells show the description."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            action.help = "what to do"  # shtab omits a suppressed action
            for name, command in action.choices.items():
                command.description = COMMANDS[name][1]
