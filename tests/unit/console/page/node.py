"""Asks the page's own modules, in one process of Node: starting it takes longer than any answer."""

from __future__ import annotations

import contextlib
import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.programs.processes import requires

FOLDER = Path(__file__).resolve().parents[4] / "gateway/console/page/js/sky"
_NODE: list[subprocess.Popen[str]] = []


@contextlib.contextmanager
def running() -> Iterator[None]:
    requires("node")
    words = ["node", str(Path(__file__).with_name("answers.mjs")), str(FOLDER)]
    pipe = subprocess.PIPE
    with subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=pipe, text=True, encoding="utf-8") as process:
        _NODE.append(process)
        yield
        _NODE.clear()
        process.communicate(timeout=60.0)


def ask(*questions: tuple[Any, ...]) -> list[Any]:
    """Answers to ``(function, arguments…)``; the functions are those of ``answers.mjs``."""
    [process] = _NODE
    assert process.stdin is not None and process.stdout is not None and process.stderr is not None
    process.stdin.write(json.dumps(questions) + "\n")
    process.stdin.flush()
    told = process.stdout.readline()
    assert told, process.stderr.read()
    found: list[Any] = json.loads(told)
    return found
