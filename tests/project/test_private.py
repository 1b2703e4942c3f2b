"""Tests use no private attribute of the gateway: what they prove stays true when its inside is built anew."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from tests.support.doc_blocks import ROOT

#: What is used all the same. A name is taken from this list with its last use, and none is added.
NAMES = """_almanac_until _buffer _by_host _coasts_until _connect_watchdog _deferral_timers _drive_rate _epoch
    _escape_for_argparse _failure_reason _frame _held_pieces _inbox _is_online _last_polled_at _last_replies
    _lock _mark_down _mark_up _measure_rate _moon_from_site _notes_logged_once _on_data _opcodes _open_truth_file
    _pending _put _replies _reply_cache _runner _saved_states _say_new_addresses _send _send_change
    _sent_readings _shared_tasks _SimulatedConnection _state _suns_valid_until _surface_argument _task
    _transport _unterminated_names _unterminated_text _urgent_times _wait_for_mount _waiters _writer"""


def is_private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__")


def made(tree: ast.AST) -> Iterator[str]:
    """Yield the names that a module defines: attributes of its objects, functions, classes and constants."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "self":
            yield node.attr


def used(tree: ast.AST) -> Iterator[str]:
    """Yield the private names that a module takes from an object other than itself, or imports of the gateway."""
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Attribute)
            and is_private(node.attr)
            and ast.unparse(node.value) not in ("self", "cls", "super()")
        ):
            yield node.attr
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gateway"):
            yield from (alias.name for alias in node.names)


def trees(folder: str) -> Iterator[tuple[Path, ast.AST]]:
    for path in sorted((ROOT / folder).rglob("*.py")):
        yield path, ast.parse(path.read_text("utf-8"))


def test_tests_use_no_private_attribute_of_the_gateway() -> None:
    gateways = set(filter(is_private, (name for _, tree in trees("gateway") for name in made(tree))))
    exceptions = set(NAMES.split())
    for path, tree in trees("tests"):
        foreign = {name for name in used(tree) if name in gateways} - exceptions
        assert not foreign - set(made(tree)), (path, foreign)
