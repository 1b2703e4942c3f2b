"""What was measured gets into gateway.toml, and nothing else of the file changes."""

from __future__ import annotations

from pathlib import Path

import pytest

from gateway.app.config import make_config, read_tables
from gateway.diagnostics.prove.adapting import adapted

FILES = (
    '# mine\n[mount]\nat = "nexstar@sim"  # the pier\nrun-on = 0.7\n\n[[surface]]\nat = "lx200@tcp://:0"\n',
    '[[mount]]\nname = "pier"\nat = "nexstar@sim"\nrun-on = 0.7\n[[surface]]\nat = "lx200@tcp://:0"\n',
)
RATES = [0.002, 0.004, 0.016, 0.03, 0.06, 0.18, 0.9, 2.7, 4.5]


@pytest.mark.parametrize("text", FILES)
def test_keys_are_added_below_the_mount_or_replaced(text: str, tmp_path: Path) -> None:
    (path := tmp_path / "gateway.toml").write_text(text)
    after, changes = adapted(path, {"run-on": 1.5, "rates": RATES})
    path.write_text(after)
    mount = make_config(*read_tables(path)).mount[0]
    assert (mount.run_on, mount.rates) == (1.5, RATES)
    assert [line[:8] for line in changes] == ["- run-on", "+ run-on", "+ rates "]


@pytest.mark.parametrize(
    "text",
    [
        '[[surface]]\nat = "lx200@tcp://:0"\n',
        'mount = { at = "nexstar@sim" }\n',
        '[mount]\nat = "nexstar@sim"\nrates = [1,\n2, 3, 4, 5, 6, 7, 8, 9]\n',
    ],
)
def test_what_cannot_be_changed_line_by_line_is_shown_and_not_written(text: str, tmp_path: Path) -> None:
    """It is left to the owner, and the file for the authors can be made nevertheless."""
    (path := tmp_path / "gateway.toml").write_text(text)
    for file in (path, None):
        after, changes = adapted(file, {"rates": RATES})
        assert after == "" and changes[-1].startswith("+ rates = [0.002,")
