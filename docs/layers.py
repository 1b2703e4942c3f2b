"""Draws the picture of the layers in docs/architecture.md from the imports that are really in the code.

``python docs/layers.py`` writes it; a test compares. Imports inside functions and under ``TYPE_CHECKING`` count. An
arrow that follows from others is left out: ``cli`` reaches ``core`` through ``app``, so it has no arrow of its own.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "architecture.md"
BEGIN, END = "<!-- layers: python docs/layers.py -->\n", "<!-- end of layers -->\n"

Graph = dict[str, set[str]]
#: What each folder of ``gateway/`` is.
PURPOSE = {
    "app": "A whole gateway: its configuration, state on disk, control by other processes, discovery on the network.",
    "astro": "The sky: spherical geometry, positions of Sun, Moon and planets, and catalogues of objects.",
    "cli": "The command line: its parser, and the commands.",
    "clients": "Clients: how they are admitted, recognised, and answered in order.",
    "console": "The console: a page in the browser that shows and moves the mounts of this gateway.",
    "core": "Values that all other layers share: operations, errors, signals, and the log of the wire.",
    "diagnostics": "Tools that examine a gateway from outside: rehearsals, recordings, captures, port detection.",
    "fleet": "Many mounts on one MQTT broker: each gateway publishes its mounts, and one page shows all.",
    "mount": "One mount: its line, its readings, its motion, its limits, and its site and clock.",
    "protocols": "One folder per protocol: its framing, its surface, its driver and its simulator.",
    "system": "What the operating system gives a process: locks, folders, file limits, streams, the journal.",
    "transport": "Ports for clients: TCP, RFC 2217, a pseudo-terminal with a stable name, a real serial port.",
}


def layers() -> list[str]:
    """Return the folders of ``gateway/``."""
    return sorted(path.parent.name for path in (ROOT / "gateway").glob("*/__init__.py"))


@cache
def imports() -> Graph:
    """Return layer -> the other layers that its modules import from."""
    known = layers()
    found: Graph = {name: set() for name in known}
    for name in known:
        for path in (ROOT / "gateway" / name).rglob("*.py"):
            found[name] |= {layer for layer in _imported(path) if layer in known and layer != name}
    return found


def _imported(path: Path) -> Iterator[str]:
    """Yield the second part of every ``gateway.X…`` that a module imports, wherever the import stands."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        for parts in (name.split(".") for name in names):
            if parts[0] == "gateway" and len(parts) > 1:
                yield parts[1]


def reached(graph: Graph, start: str) -> set[str]:
    """Return every layer that can be reached from one, in any number of steps."""
    seen: set[str] = set()
    waiting = [start]
    while waiting:
        for layer in graph[waiting.pop()] - seen:
            seen.add(layer)
            waiting.append(layer)
    return seen


def drawn(graph: Graph) -> Graph:
    """Return the arrows that do not follow from others."""
    return {
        name: {layer for layer in below if not any(layer in reached(graph, other) for other in below - {layer})}
        for name, below in graph.items()
    }


def picture() -> str:
    """Return the block between the two marks."""
    graph = imports()
    order = sorted(graph, key=lambda name: (-len(reached(graph, name)), name))
    arrows = [f"    {name} --> {below}" for name in order for below in sorted(drawn(graph)[name])]
    rows = [f"| `{name}/` | {PURPOSE[name]} | {', '.join(sorted(graph[name])) or 'nothing'} |" for name in order]
    return "\n".join(
        [
            "```mermaid", "graph TD", *arrows, "```", "",
            "| folder | what it is | imports from |", "|---|---|---|", *rows, "",
        ]
    )  # fmt: skip


def refreshed(text: str) -> str:
    """Return the page with the picture of the layers as they are now."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}{picture()}{END}{after}"


if __name__ == "__main__":
    PAGE.write_text(refreshed(PAGE.read_text("utf-8")), "utf-8")
    sys.stdout.write(f"{PAGE} shows the layers as they are\n")
