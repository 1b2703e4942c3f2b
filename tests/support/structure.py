"""Finds import circles of the package. Every import counts, also inside a function or under TYPE_CHECKING."""

from __future__ import annotations

import ast
import functools
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any


@functools.cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text("utf-8"))


def imports(path: Path, name: str, package: str = "gateway") -> set[str]:
    """Return the modules that a file imports anywhere, as written: ``from a import b`` gives ``a`` and ``a.b``."""
    found: set[str] = set()
    for node in ast.walk(_tree(path)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found |= {f"{node.module}.{alias.name}" for alias in node.names} | {node.module}
    return {one for one in found if one.split(".")[0] == package and one != name}


def import_graph(root: Path) -> dict[str, set[str]]:
    """Return module -> the package's modules it imports, leaving out packages that are only on the path to a module."""
    files = {}
    for path in sorted(root.rglob("*.py")):
        parts = (root.name, *path.relative_to(root).with_suffix("").parts)
        files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    graph = {}
    for name, path in files.items():
        wanted = {one for one in imports(path, name, root.name) if one in files}
        exact = {one for one in wanted if not any(other.startswith(f"{one}.") for other in wanted)}
        empty = {one for one in wanted - exact if len(_tree(files[one]).body) <= 1}
        graph[name] = (wanted - empty) - {name}
    return graph


def circles(graph: Mapping[Any, Iterable[Any]]) -> list[list[Any]]:
    """Return the strongly connected components with more than one node, the largest first."""
    number: dict[Any, int] = {}
    low: dict[Any, int] = {}
    stack: list[Any] = []
    found: list[list[Any]] = []

    def visit(start: Any) -> None:
        work: list[tuple[Any, Iterator[Any]]] = [(start, iter(graph.get(start, ())))]
        number[start] = low[start] = len(number)
        stack.append(start)
        while work:
            node, others = work[-1]
            for other in others:
                if other not in number:
                    number[other] = low[other] = len(number)
                    stack.append(other)
                    work.append((other, iter(graph.get(other, ()))))
                    break
                if other in stack:
                    low[node] = min(low[node], number[other])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[node])
                if low[node] == number[node]:
                    at = stack.index(node)
                    if len(stack) - at > 1:
                        found.append(sorted(stack[at:], key=str))
                    del stack[at:]

    for node in graph:
        if node not in number:
            visit(node)
    return sorted(found, key=lambda circle: (-len(circle), str(circle)))
