"""Measures the structure of the package: import circles, and classes that reach each other at run time.

Every import counts, also inside a function or under TYPE_CHECKING. At run time an object reaches what its attributes
hold, also through containers, bound methods, closures and partial functions. The subscribers of a signal do not count
as reached by its sender, which does not know them.
"""

from __future__ import annotations

import ast
import asyncio
import functools
import types
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
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


# --- classes at run time ----------------------------------------------------------------------------------------------

_OPAQUE = (
    str,
    bytes,
    bytearray,
    int,
    float,
    complex,
    type,
    types.ModuleType,
    asyncio.Future,
    asyncio.Handle,
    asyncio.AbstractEventLoop,
)


def attributes(thing: Any) -> Iterator[Any]:
    """Yield the values of an object's own attributes."""
    yield from vars(thing).values() if hasattr(thing, "__dict__") else ()
    for kind in type(thing).__mro__:
        slots = kind.__dict__.get("__slots__", ())
        for name in (slots,) if isinstance(slots, str) else slots:
            if name not in ("__dict__", "__weakref__") and hasattr(thing, name):
                yield getattr(thing, name)


def _through(thing: Any) -> Iterable[Any]:
    """Return what can be reached through an object that does not count itself."""
    if isinstance(thing, _OPAQUE) or thing is None:
        return ()
    if isinstance(thing, Mapping):
        return [*thing.keys(), *thing.values()]
    if isinstance(thing, list | tuple | set | frozenset | deque):
        return list(thing)
    if isinstance(thing, types.MethodType):
        return [thing.__self__]
    if isinstance(thing, functools.partial):
        return [thing.func, *thing.args, *thing.keywords.values()]
    if isinstance(thing, types.FunctionType):
        cells = []
        for cell in thing.__closure__ or ():
            try:
                cells.append(cell.cell_contents)
            except ValueError:  # not bound yet
                continue
        return cells
    return list(attributes(thing)) if type(thing).__module__.startswith("gateway.") else ()


def reached(thing: Any, counts: Callable[[type], bool], stops: Callable[[Any], bool]) -> list[Any]:
    """Return the objects whose classes count, if ``thing`` reaches them without passing through another such object."""
    seen, found = {id(thing)}, []
    work = deque(attributes(thing))
    keep = [thing]
    while work:
        one = work.popleft()
        if id(one) in seen or stops(one):
            continue
        seen.add(id(one))
        keep.append(one)
        if counts(type(one)):
            found.append(one)
        else:
            work.extend(_through(one))
    return found


def class_graph(root: Any, package: str, stops: Callable[[Any], bool] = lambda thing: False) -> dict[str, set[str]]:
    """Return class -> the classes of the package that its instances reach, starting at one object."""

    def counts(kind: type) -> bool:
        return f"{kind.__module__}.".startswith(f"{package}.")

    graph: dict[str, set[str]] = {}
    work, seen = deque([root]), {id(root)}
    while work:
        thing = work.popleft()
        name = f"{type(thing).__module__}.{type(thing).__qualname__}"
        others = reached(thing, counts, stops)
        graph.setdefault(name, set()).update(f"{type(one).__module__}.{type(one).__qualname__}" for one in others)
        for one in others:
            if id(one) not in seen:
                seen.add(id(one))
                work.append(one)
    return graph
