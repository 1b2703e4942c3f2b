"""The configuration as text: the one in effect reads back, the example is complete, the table of the keys is fresh."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import tomli

from gateway.app.config import Source, make_config, read_tables
from gateway.app.config.describing import keys_of
from gateway.app.config.keys import SurfaceConfig
from gateway.app.config.programs import with_needs
from gateway.app.config.showing import effective_toml, example_toml, to_toml
from gateway.app.config.source import Place
from gateway.app.config.tables import Config, ConsoleConfig
from gateway.cli import main
from tests.support.each import each

ALL = """log = true
[[mount]]
name = "pier"
at = "nexstar:cge/4.21@/dev/ttyUSB0"
site = [-33.5, 151.25]
park = [1, 2]
[[mount]]
name = "dome"
at = "lx200@sim"
lowest = 12.5
[[surface]]
mount = "pier"
at = "lx200@tcp://:4030"
client = "stellarium"
[[surface]]
mount = "dome"
at = "lx200@tcp://:4031"
client = "starry-night"
precision = "high"
sync-text = "say \\"when\\" \\\\ now"
"""


def back(tmp_path: Path, text: str) -> tuple[Config, Source]:
    path = tmp_path / "gateway.toml"
    path.write_text(text, "utf-8")
    tables, source = read_tables(path)
    return make_config(tables, source), source


def test_printed_configuration_reads_back_as_the_same(tmp_path: Path) -> None:
    config, source = back(tmp_path, ALL)
    again, _ = back(tmp_path, effective_toml(config, source))
    assert (again.mount, again.wait, again.log) == (config.mount, config.wait, config.log)
    assert again.surface == [with_needs(surface) for surface in config.surface]
    assert again.surface[0].sync_text is not None


def test_printed_configuration_says_where_each_changed_value_comes_from(tmp_path: Path) -> None:
    config, source = back(tmp_path, ALL)
    source.name = "g.toml"
    source.flags[("mount", 1, "lowest")] = "--lowest"
    lines = effective_toml(config, source).splitlines()
    assert "log = true  # g.toml:1" in lines
    assert "site = [-33.5, 151.25]  # g.toml:5" in lines
    assert "lowest = 12.5  # --lowest" in lines
    assert "# lowest: not set" in lines
    assert "sync-limit = 15.0" in lines
    assert 'precision = "high"  # g.toml:19' in lines
    assert any(line.startswith('sync-text = "1M31') and "# client stellarium: " in line for line in lines)
    assert "# mode: not set" in lines


def test_printed_configuration_adds_no_origin_comment_to_defaults() -> None:
    flags: dict[Place, str] = {("mount", 0, "at"): "--mount", ("surface", 0): "--surface"}
    tables = {"mount": [{"at": "nexstar@sim"}], "surface": [{"at": "lx200@tcp://:0"}]}
    source = Source("command line", flags=flags)
    lines = effective_toml(make_config(tables, source), source).splitlines()[2:]
    assert [line for line in lines if "  # " in line] == [
        'at = "nexstar@sim"  # --mount',
        'at = "lx200@tcp://:0"  # --surface',
    ]


def test_example_configuration_has_keys_without_a_default_as_comments(tmp_path: Path) -> None:
    config, _ = back(tmp_path, example_toml())
    assert config.console == ConsoleConfig()
    assert config.surface[0] == SurfaceConfig(config.surface[0].at)


def test_example_configuration_has_every_key(tmp_path: Path) -> None:
    text = re.sub(r"(?m)^#(?! )", "", example_toml())
    back(tmp_path, text)
    tables = tomli.loads(text)
    assert set(tables["mount"]) == {key.name for key in keys_of("mount")}
    assert set(tables["surface"][0]) == {key.name for key in keys_of("surface")}
    assert set(tables["console"]) == {key.name for key in keys_of("console")}
    assert set(tables["mqtt"]) == {key.name for key in keys_of("mqtt")}
    assert set(tables) == {"mount", "surface", "console", "mqtt"} | {key.name for key in keys_of("")}


def test_every_config_key_has_a_description() -> None:
    for name in ("", "mount", "surface", "console"):
        for key in keys_of(name):
            assert key.description
            assert key.allowed
            assert key.example is not None, key.name
            assert isinstance(key.default, bool) or key.metavar, key.name


@each("value", [True, 0, -1.5, 'a "b" \\ \x7f \n é', [1.0, -2.0], ["a"]])
def test_printed_configuration_writes_values_as_toml(value: object) -> None:
    assert tomli.loads(f"x = {to_toml(value)}") == {"x": value}


def test_config_command_prints_the_configuration_and_the_example(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["config", "--mount", "nexstar@sim", "--surface", "lx200@tcp://:0", "--site", "-33.9,151.2"]) == 0
    assert tomli.loads(capsys.readouterr().out)["mount"]["site"] == [-33.9, 151.2]
    assert main(["config", "--example"]) == 0
    assert capsys.readouterr().out == example_toml()
