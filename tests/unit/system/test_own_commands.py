"""How this program starts itself, as a package and as one file."""

from __future__ import annotations

import sys

import pytest

from gateway.system import own_commands


def test_single_file_mount_gateway_starts_itself_without_python_options(monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes no ``-m``: whatever it is started with are arguments of mount-gateway."""
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    assert own_commands.gateway_argv() == [sys.executable]
    assert own_commands.own_command() == sys.executable
    assert own_commands.script_argv("/a/script.py") == [sys.executable, own_commands.RUN_SCRIPT_OPTION, "/a/script.py"]
    assert own_commands.pip_command().endswith("cannot be added to: pip")
    assert "with pip instead of this one file" in own_commands.install_instruction("mqtt")
