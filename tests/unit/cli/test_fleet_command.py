"""``fleet``: what is wrong with its flags is told in a line, before anything is opened."""

from __future__ import annotations

import pytest

from gateway.cli import main

pytest.importorskip("aiomqtt")


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        ([], "--mqtt"),
        (["--mqtt", "pi"], "write mqtt://HOST:PORT"),
        (["--mqtt", "mqtt://eve:secret@pi"], "the address contains a password"),
        (["--mqtt", "mqtt://pi", "--prefix", "a/#"], "--prefix 'a/#': write words"),
        (["--mqtt", "mqtt://pi", "--port", "70000"], "--port 70000: write a number"),
        (["--mqtt", "mqtt://pi", "--password-file", "/none/such"], "/none/such: there is no folder"),
    ],
)
def test_fleet_command_explains_mistakes_in_its_flags(
    flags: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fleet", *flags]) == 2
    told = capsys.readouterr().err
    assert words in told and "secret" not in told and told.count("\n") == 1
