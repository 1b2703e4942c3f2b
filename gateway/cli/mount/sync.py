"""``sync``: tell the mount where it points, for whoever has centred an object in the eyepiece."""

from __future__ import annotations

import argparse

from gateway.cli.help import Commands


def add(commands: Commands) -> None:
    from gateway.cli.mount.asking import add_which
    from gateway.cli.mount.places import PLACES, add_place

    sync = commands.add_parser(
        "sync", help="tell the mount that it points to a place or an object now",
        description="Tells the mount of the gateway that runs here where it points now: centre an object first. One "
                    "that is too far away is refused (--sync-limit of run), and so is one while the mount moves.",
        epilog=f"Example:\n  mount-gateway sync HIP32349\n\n{PLACES}",
    )  # fmt: skip
    add_place(sync)
    add_which(sync)
    sync.set_defaults(run=_sync)


def _sync(arguments: argparse.Namespace) -> int:
    from gateway.app.control import commands as wishes
    from gateway.cli.mount.asking import wish_for
    from gateway.cli.mount.places import place

    return wish_for(arguments, lambda number: wishes.Sync(number, place(arguments)))
