"""The keys of ``[console]``, the page that a browser shows."""

from __future__ import annotations

from typing import Annotated

from msgspec import Struct

from gateway.app.config.declaring import Plain, key


class ConsoleConfig(Struct, frozen=True, forbid_unknown_fields=True, rename="kebab"):
    """``[console]``: the page that shows the mounts in a browser."""

    at: Annotated[
        str,
        key(
            "where a browser finds the console; another free port is taken where this one is not; off: there is none",
            "tcp://HOST:PORT",
        ),
    ] = "tcp://127.0.0.1:4080"
    allow: Annotated[
        list[str] | None,
        key(
            "only browsers of these networks or addresses are shown anything (default: all that reach the port)",
            "NETWORKS",
            ["192.168.1.0/24", "127.0.0.1"],
        ),
    ] = None
    read_only: Annotated[
        bool | list[str],
        key("pages show the mounts and may stop them, but move and set nothing: all, or those of these networks",
             "NETWORKS"),
    ] = False  # fmt: skip
    pin: Annotated[
        Plain | None, key("without it a page only looks and stops; whoever types it in may act", "PIN", "4711")
    ] = None
    names: Annotated[
        list[str], key("further names under which browsers reach this computer", "NAMES", ["pier.example.org"])
    ] = []  # fmt: skip
