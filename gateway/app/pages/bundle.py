"""One script of many modules, so that a page is there after few round trips.

Nothing is compiled; lines of comments are left out. Every module becomes a function that is called when it is first
needed, and its exports are those that other modules name. The modules keep to one style: imports at the beginning of a
line, no default exports, no circles, no exported variable that changes. What does not is an error at the start.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Mapping

_IMPORT = re.compile(r'^import\s+(?:\*\s+as\s+(\w+)|(\{[^}]*\}))\s+from\s+"([^"]+)";', re.M)
_LATER = re.compile(r'\bimport\("([^"]+)"\)')
_EXPORT = re.compile(r"^export\s+((?:async\s+)?(?:function|class|const)\s+(\w+))", re.M)
_COMMENT = re.compile(r"^[ \t]*(?://.*|/\*\*(?:.|\n)*?\*/[ \t]*)\n", re.M)
_UNKNOWN = re.compile(r"^(?:import|export)\b.*", re.M)


def scripts(texts: Mapping[str, str], main: str, at: str) -> str:
    """Return the script ``main`` and all that it imports as one module, served in the folder ``at``.

    ``texts`` are the files by their paths. Raises ValueError for a module of another style.
    """
    bodies: dict[str, str] = {}
    exports: dict[str, set[str]] = {}
    under_way: list[str] = []

    def visit(path: str) -> int:
        if path in under_way:
            raise ValueError(f"{path} imports itself: {' > '.join(under_way)}")
        if path in bodies:
            return list(bodies).index(path)
        under_way.append(path)
        text = _COMMENT.sub("", texts[path])

        def of(other: str) -> str:
            return posixpath.normpath(posixpath.join(posixpath.dirname(path), other))

        def imported(found: re.Match[str]) -> str:
            whole, some, other = found.groups()
            number = visit(of(other))
            names = [name.split(" as ") for name in " ".join((some or "{}")[1:-1].split()).split(",")]
            exports[of(other)] |= {name[0].strip() for name in names if name[0].strip()}
            picked = ", ".join(": ".join(map(str.strip, name)) for name in names)
            return f"const {whole or f'{{ {picked} }}'} = get({number});"

        text = _IMPORT.sub(imported, text)
        text = _LATER.sub(lambda found: f"Promise.resolve().then(() => get({visit(of(found[1]))}))", text)
        exports.setdefault(path, set()).update(name for _, name in _EXPORT.findall(text))
        text = _EXPORT.sub(r"\1", text)
        text = re.sub(r"^export (?=const\b)", "", text, flags=re.M)
        if unknown := _UNKNOWN.search(text):
            raise ValueError(f"{path}: {unknown[0]}")
        here = posixpath.relpath(path, at or ".")
        bodies[path] = text.replace("import.meta.url", f'new URL("{here}", import.meta.url)')
        under_way.pop()
        return len(bodies) - 1

    number = visit(main)
    parts = [
        f"// {path}\n() => {{\n{body}\nreturn {{ {', '.join(sorted(exports[path]))} }};\n}},\n"
        for path, body in bodies.items()
    ]
    head = "const made = [];\nconst get = (number) => (made[number] ??= modules[number]());\nconst modules = [\n"
    return f"{head}{''.join(parts)}];\nget({number});\n"
