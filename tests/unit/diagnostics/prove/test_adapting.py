"""What was measured gets into gateway.toml, and nothing else of the file changes."""

from __future__ import annotations

from pathlib import Path

import pytest

from gateway.app.config import make_config, read_tables
from gateway.core.errors import UserError
from gateway.diagnostics.prove.adapting import adapted, difference

FILES = (
    '# mine\n[mount]\nat = "nexstar@sim"  # the pier\nrun-on = 0.7\n\n[[surface]]\nat = "lx200@tcp://:0"\n',
    '[[mount]]\nname = "pier"\nat = "nexstar@sim"\nrun-on = 0.7\n[[surface]]\nat = "lx200@tcp://:0"\n',
)
RATES = [0.002, 0.004, 0.016, 0.03, 0.06, 0.18, 0.9, 2.7, 4.5]


@pytest.mark.parametrize("text", FILES)
def test_keys_are_added_below_the_mount_or_replaced(text: str, tmp_path: Path) -> None:
    (path := tmp_path / "gateway.toml").write_text(text)
    before, after = adapted(path, {"run-on": 1.5, "rates": RATES})
    assert before == text
    path.write_text(after)
    mount = make_config(*read_tables(path)).mount[0]
    assert (mount.run_on, mount.rates) == (1.5, RATES)
    assert [line[:8] for line in difference(before, after)] == ["+ rates ", "- run-on", "+ run-on"]


def test_a_file_without_a_mount_is_refused(tmp_path: Path) -> None:
    (path := tmp_path / "gateway.toml").write_text('[[surface]]\nat = "lx200@tcp://:0"\n')
    with pytest.raises(UserError, match="no mount"):
        adapted(path, {"run-on": 1.5})
