"""The floors of the house: imports point down only, I/O stays on the upper ones, nobody below knows both protocols."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import gateway

ROOT = Path(gateway.__file__).parent
FLOORS = {
    "errors": 0,
    "operations": 0,
    "frames": 0,
    "motion_kinds": 1,
    "__init__": 0,
    "spherical": 1,
    "sexagesimal": 1,
    "codecs": 1,
    "pictures": 1,
    "transcript": 1,
    "kinematics": 2,
    "mount_geometry": 2,
    "motors": 2,
    "axis_motion": 2,
    "tables": 2,
    "sky": 3,
    "library": 3,
    "surface": 3,
    "driver": 3,
    "driving": 5,
    "doubt": 4,
    "talk": 5,
    "observatory": 3,
    "log": 6,
    "presets": 3,
    "journal": 1,
    "status": 2,
    "notify": 5,
    "protocols": 4,
    "equinox": 4,
    "virtual": 5,
    "wires": 5,
    "pacing": 5,
    "line": 5,
    "hub": 5,
    "access": 5,
    "strangers": 1,
    "beginning": 2,
    "begun": 5,
    "sealed": 1,
    "backlog": 5,
    "shared_work": 5,
    "descriptors": 4,
    "streams": 6,
    "clients": 5,
    "ports": 5,
    "announce": 5,
    "guests": 5,
    "state": 5,
    "mark": 5,
    "mount": 5,
    "watchdog": 5,
    "keeping": 5,
    "hold": 5,
    "locks": 5,
    "runtime": 5,
    "processes": 5,
    "mount_claim": 6,
    "reach": 6,
    "control": 5,
    "detect": 6,
    "pairs": 5,
    "config": 6,
    "simulators": 6,
    "truth": 6,
    "rehearsal": 6,
    "rescue": 6,
    "assembly": 6,
    "turns": 5,
    "recorder": 5,
    "entrance": 5,
    "recorded": 5,
    "retraced": 5,
    "retracing": 6,
    "replaying": 6,
    "recording": 3,
    "captures": 3,
    "decode": 6,
    "cli": 7,
    "__main__": 7,
}
#: Two that import each other, for types only; no more may come.
CIRCLES = {frozenset(("begun", "clients"))}
IO_MODULES = {"asyncio", "socket", "serial", "threading", "selectors"}


def _modules() -> list[tuple[str, Path]]:
    return [(path.relative_to(ROOT).with_suffix("").parts[0], path) for path in sorted(ROOT.rglob("*.py"))]


@cache
def _imports(path: Path) -> set[str]:
    """Every module imported anywhere in a file, ``gateway.x`` as written."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} if node.module != "gateway" else {f"gateway.{alias.name}" for alias in node.names}
    return names


def test_every_module_has_a_floor() -> None:
    assert {name for name, _ in _modules()} == set(FLOORS)


def test_imports_point_down() -> None:
    wrong = []
    for name, path in _modules():
        for imported in _imports(path):
            parts = imported.split(".")
            if parts[0] != "gateway" or len(parts) < 2 or parts[1] in (name, "__version__"):
                continue
            if FLOORS[parts[1]] > FLOORS[name]:
                wrong.append(f"{path.relative_to(ROOT)} imports {imported}")
    assert wrong == []


def test_on_one_floor_nobody_is_imported_by_what_it_imports() -> None:
    """Also for types alone: whoever needs another's types is above it."""
    graph: dict[str, set[str]] = {name: set() for name in FLOORS}
    for name, path in _modules():
        graph[name] |= {
            parts[1] for imported in _imports(path) if (parts := imported.split("."))[0] == "gateway" and len(parts) > 1
        } & set(FLOORS) - {name}
    above = {name: _reached(graph, name) for name in graph}
    assert {frozenset((one, other)) for one in graph for other in above[one] if one in above[other]} <= CIRCLES


def _reached(graph: dict[str, set[str]], start: str) -> set[str]:
    """All that a module imports, and what those import."""
    found: set[str] = set()
    ahead = [start]
    while ahead:
        new = graph[ahead.pop()] - found
        found |= new
        ahead += new
    return found - {start}


def test_input_and_output_live_on_the_upper_floors() -> None:
    allowed_low = {"sky"}  # loads its library on a thread
    wrong = [
        f"{path.relative_to(ROOT)} imports {imported}"
        for name, path in _modules()
        for imported in _imports(path)
        if imported.split(".")[0] in IO_MODULES and FLOORS[name] < 5 and name not in allowed_low
    ]
    assert wrong == []


def test_no_protocol_knows_another() -> None:
    wrong = [
        f"{path.relative_to(ROOT)} imports {imported}"
        for path in (ROOT / "protocols").rglob("*.py")
        for imported in _imports(path)
        if imported.startswith("gateway.protocols.")
        and imported.split(".")[2] != path.relative_to(ROOT / "protocols").parts[0]
    ]
    assert wrong == []


def test_the_lower_floors_name_no_protocol() -> None:
    wrong = [
        f"{path.relative_to(ROOT)} imports {imported}"
        for name, path in _modules()
        for imported in _imports(path)
        if FLOORS[name] < 5 and name != "protocols" and imported.startswith("gateway.protocols.")
    ]
    assert wrong == []


def test_what_belongs_to_one_mount_knows_no_hub() -> None:
    wrong = [
        f"{path.relative_to(ROOT)} imports {imported}"
        for path in (ROOT / "mount").rglob("*.py")
        for imported in _imports(path)
        if imported.startswith("gateway.mount")
    ]
    assert wrong == []


def test_what_belongs_to_one_mount_imports_in_no_circle() -> None:
    """What is imported for types alone counts as well."""
    files = {
        ".".join(("gateway", *path.relative_to(ROOT).with_suffix("").parts)): path
        for path in (ROOT / "mount").rglob("*.py")
        if path.name != "__init__.py"
    }
    left = {name: {one for one in _modules_of(path) if one in files} for name, path in files.items()}
    while free := {name for name, needs in left.items() if not needs & left.keys()}:
        left = {name: needs for name, needs in left.items() if name not in free}
    assert left == {}


def _modules_of(path: Path) -> set[str]:
    """Every module imported in a file, also where it is named after the package that it is in."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names
