"""What every import of an own module that stands inside a function saves where it stands: milliseconds and KiB.

    python tests/benchmarks/inner_imports.py

Each is measured in a process of its own that has loaded the command line and the module around it: the processor time
and the resident memory that the import takes, the smaller of three. docs/scale.md says which of them are worth it.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MEASURE = """
import importlib, re, sys, time
def resident(): return int(re.search(r"VmRSS:\\s+(\\d+)", open("/proc/self/status").read())[1])
importlib.import_module("gateway.cli"), importlib.import_module(sys.argv[1])
began, before = time.process_time(), resident()
for name in sys.argv[2:]:
    try: importlib.import_module(name)
    except ModuleNotFoundError: pass
print((time.process_time() - began) * 1000.0, resident() - before)
"""


def inner_imports() -> Iterator[tuple[str, int, list[str]]]:
    """Yield file, line, and the names that are imported, as modules."""
    for path in sorted((ROOT / "gateway").rglob("*.py")):
        for function in ast.walk(ast.parse(path.read_text("utf-8"))):
            if not isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
                continue
            for node in ast.walk(function):
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gateway."):
                    names = [f"{node.module}.{alias.name}" for alias in node.names]
                    yield str(path.relative_to(ROOT)), node.lineno, [str(node.module), *names]


def main() -> int:
    for path, line, names in inner_imports():
        module = path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        command = [sys.executable, "-c", MEASURE, module, *names]
        runs = [subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout.split() for _ in range(3)]
        took, size = (min(float(run[which]) for run in runs) for which in (0, 1))
        print(f"{took:7.1f} ms {size:7.0f} KiB  {path}:{line} {names[0]}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
