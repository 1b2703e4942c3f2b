"""``gateway.toml`` and flags: what is read, and the one line with its place that a mistake gets."""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest
import tomli
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from gateway.app.config import Config, make_config, read_tables
from gateway.app.config.describing import keys_of
from gateway.app.config.source import Source, line_of
from gateway.cli.serve.settings import add_setting_flags, load_config
from gateway.core.errors import UserError
from tests.support.each import each
from tests.support.sampling import as_a_rule

SURFACE = '[[surface]]\nat = "lx200@tcp://:0"\n'
MOUNT = '[mount]\nat = "nexstar@sim"\n'
TWO = '[[mount]]\nname = "a"\nat = "nexstar@sim"\n[[mount]]\nname = "b"\nat = "lx200@sim"\n'
A, B = f'{SURFACE}mount = "a"\n', f'{SURFACE}mount = "b"\n'


def read(tmp_path: Path, text: str) -> Config:
    path = tmp_path / "gateway.toml"
    path.write_text(text, "utf-8")
    return make_config(*read_tables(path))


def flags(*words: str) -> Config:
    parser = argparse.ArgumentParser()
    add_setting_flags(parser)
    mount = [] if "--mount" in words else ["--mount", "nexstar@sim"]
    return load_config(parser.parse_args([*mount, "--surface", "lx200@tcp://:0", *words]))[0]


@each(
    ("text", "line", "says"),
    [
        (f"{MOUNT}equnox = 'jnow'\n{SURFACE}", 3, "did you mean 'equinox'?"),
        (f"{MOUNT}\n# a word\nbaud = true\n{SURFACE}", 5, "[mount] baud: true: write a whole number from 300"),
        (f"{MOUNT}baud = 9600.5\n{SURFACE}", 3, "baud: 9600.5: write a whole number"),
        (f"{MOUNT}baud = 12\n{SURFACE}", 3, "baud: 12: write a whole number from 300 to 921600"),
        (f"{MOUNT}lowest = nan\n{SURFACE}", 3, "lowest: nan: write a number from -90 to 90"),
        (f"{MOUNT}lowest = 50\nhighest = 50\n{SURFACE}", 3, "write less than highest"),
        (f"{MOUNT}guide-rate = 0\n{SURFACE}", 3, "write a number more than 0 and up to"),
        (f"{MOUNT}guide-rate = 50\n{SURFACE}", 3, "guide-rate: 50"),
        (f"{MOUNT}park = [10]\n{SURFACE}", 3, "park: [10]: write [a number from -360 to 360, a number"),
        (f"{MOUNT}park = [\n  10.0,\n  200.0,\n]\n{SURFACE}", 3, "park: [10.0, 200.0]"),
        (f"{MOUNT}site = '48.1,11.6'\n{SURFACE}", 3, "write [a number from -90 to 90"),
        (f"{MOUNT}site = [151.2, -33.9]\n{SURFACE}", 3, "the latitude comes first: -33.9,151.2?"),
        (f"{MOUNT}mode = 'altaz'\n{SURFACE}", 3, "mode: 'altaz': write one of alt-az, eq-north, eq-south"),
        (f"{MOUNT}[surface]\nat = 'lx200@tcp://:0'\n", 3, "write [[surface]]"),
        (f"lowest = 1\n{MOUNT}{SURFACE}", 1, "there is no such key"),
        (f"{MOUNT}precision = 'low'\n{SURFACE}", 3, "it belongs under [[surface]]"),
        (f"[mont]\nat = 'nexstar@sim'\n{SURFACE}", 1, "did you mean 'mount'?"),
        (f"[mount]\nbaud = 9600\n{SURFACE}", 1, "[mount] at: is needed"),
        (f"mount = 'nexstar@sim'\n{SURFACE}", 1, "write [mount] and KEY = VALUE under it"),
        (f"{MOUNT}{SURFACE}[[console]]\nat = 'off'\n[[console]]\n", 5, "write [console] and KEY = VALUE under it"),
        (f"{MOUNT}{SURFACE}equinox = 'auto'\n", 5, "[[surface]] equinox: 'auto': write one of jnow, j2000"),
        (f"{MOUNT}[[surface]]\nequinox = 'jnow'\n", 3, "[[surface]] at: is needed"),
        (f"{MOUNT}{SURFACE}sync-text = 'matched#'\n", 5, "without #"),
        (f"{MOUNT}{SURFACE}client = 'stelarium'\n", 5, "did you mean 'stellarium'?"),
        (f"{MOUNT}[[surface]]\nat = 'lx200@tcp://nowhere'\n", 4, "write tcp://HOST:PORT"),
        (f"{MOUNT}[[surface]]\nat = 'lx300@tcp://:0'\n", 4, "'lx300' is neither a protocol"),
        (f"{MOUNT}[[surface]]\nat = 'any@pty:/tmp/x'\n", 4, "write any@tcp"),
        (f"{MOUNT}[[surface]]\nat = 'any@4030'\n", 4, "write any@tcp://127.0.0.1:4030, or one protocol"),
        (f"{MOUNT}[[surface]]\nat = 'any:6se@tcp://:0'\n", 4, "write any@tcp"),
        (f"[mount]\nat = 'any@sim'\n{SURFACE}", 2, "lx200@ or nexstar@ or alpaca@ for a"),
        (f"[mount]\nat = 'any@tcp://:1'\n{SURFACE}", 2, "write lx200@ or nexstar@ or alpaca@"),
        (f"{MOUNT}[[surface]]\nat = 'any@tcp://:0'\nclient = 'nope'\n", 5, "write one of skys"),
        (f"{MOUNT}{SURFACE}mount = 'pier'\n", 5, "'pier'"),
        (f"wait = 'yes'\n{MOUNT}{SURFACE}", 1, "wait: 'yes': write true or false"),
        (f"[mount]\nat = nexstar@sim\n{SURFACE}", 2, 'text is written in "quotes"'),
        (f"{MOUNT}at = 'nexstar@sim'\n{SURFACE}", 3, "already defined above"),
        (f"{MOUNT}{MOUNT}{SURFACE}", 3, "several mounts [[mount]]"),
        (f"{MOUNT}site = 48.1, 11.6\n{SURFACE}", 3, "two numbers go into [ ]"),
        (f"{MOUNT}lowest = 10,5\n{SURFACE}", 3, "a single one has a point: 10.5"),
        (f"{MOUNT}lowest = 10 5\n{SURFACE}", 3, "after a statement"),
        (f'{MOUNT}record = "C:\\Users\\me"\n{SURFACE}', 3, "write / for it"),
        (f'{SURFACE}[mount]\nat = "lx200@\\\\.\\COM12"\n', 4, "write / for it"),
        (f"{MOUNT}[[surface]]\nat = 'nexstar@pty'\n", 4, "nexstar@pty: write nexstar@pty:/tmp/telescope"),
        (f"{MOUNT}name = 'My LX200'\n{SURFACE}", 3, 'for example "My_LX200"'),
        (f"{MOUNT}lowest_altitude = 10\n{SURFACE}", 3, "did you mean 'lowest'?"),
        (f"{MOUNT}site = \"48°06'N,11°36'E\"\n{SURFACE}", 3, "for example site = [48.1, 11.6]"),
        (f"{TWO}{A}{SURFACE}", 10, "write one of a"),
        (TWO + A + SURFACE + 'mount = "c"', 12, "no mount is called 'c'"),
        (f"{TWO}{A}", 4, "no [[surface]] has mount = 'b'"),
        (TWO.replace('name = "b"', "") + A + B, 4, "[mount] name"),
        (TWO.replace('"b"', '"a"') + A + B, 5, "another mount already has the name 'a'"),
        (TWO.replace('"b"', '"b c"') + A + B, 5, "name: 'b c': write a word of letters"),
    ],
)
def test_config_error_names_the_line(tmp_path: Path, text: str, line: int, says: str) -> None:
    with pytest.raises(UserError) as caught:
        read(tmp_path, text)
    words = str(caught.value)
    assert words.startswith(f"{tmp_path}/gateway.toml:{line}: "), words
    assert says in words
    assert "\n" not in words


@each(
    ("one", "other", "clash"),
    [
        ("lx200@tcp://:4030", "nexstar@tcp://127.0.0.1:4030", True),
        ("lx200@tcp://localhost:4030", "lx200@tcp://127.0.0.1:4030", True),
        ("lx200@tcp://0.0.0.0:4030", "lx200@tcp://192.168.1.2:4030", True),
        ("lx200@tcp://127.0.0.1:4030", "lx200@tcp://192.168.1.2:4030", False),
        ("lx200@tcp://:0", "lx200@tcp://:0", False),
        ("lx200@pty:/tmp/x", "lx200@pty:/tmp/../tmp/x", True),
        ("lx200@/dev/ttyS1", "lx200@/dev/ttyS2", False),
        ("lx200@tcp://:4030", "lx200@/dev/ttyUSB0", True),
    ],
)
def test_config_refuses_two_surfaces_on_one_address(tmp_path: Path, one: str, other: str, clash: bool) -> None:
    text = f'[mount]\nat = "nexstar@/dev/ttyUSB0"\n[[surface]]\nat = "{one}"\n[[surface]]\nat = "{other}"\n'
    if not clash:
        assert len(read(tmp_path, text).surface) == 2
        return
    with pytest.raises(UserError, match="already in use by another") as caught:
        read(tmp_path, text)
    assert f"{tmp_path}/gateway.toml:6: " in str(caught.value)


def test_two_mounts_cannot_use_one_port(tmp_path: Path) -> None:
    text = TWO.replace("nexstar@sim", "nexstar@/dev/ttyS1").replace("lx200@sim", "lx200@/dev/ttyS1")
    with pytest.raises(UserError, match=r"toml:6: \[mount\] at: /dev/ttyS1"):
        read(tmp_path, text + A + B)


def test_each_surface_belongs_to_the_mount_that_it_names(tmp_path: Path) -> None:
    config = read(tmp_path, TWO + A + B.replace(":0", ":4040") + A.replace(":0", ":4050"))
    assert [[surface.at for surface in config.surfaces_of(mount)] for mount in config.mount] == [
        ["lx200@tcp://:0", "lx200@tcp://:4050"],
        ["lx200@tcp://:4040"],
    ]


def test_single_mount_needs_no_name_and_may_have_one(tmp_path: Path) -> None:
    for text in (MOUNT + SURFACE, MOUNT.replace("[mount]", "[[mount]]") + SURFACE, f'{MOUNT}name = "a"\n{A}'):
        config = read(tmp_path, text)
        assert len(config.surfaces_of(config.mount[0])) == 1


def test_missing_or_unreadable_config_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"nothing\.toml: there is no such file"):
        read_tables(tmp_path / "nothing.toml")
    (tmp_path / "image.toml").write_bytes(b"at = \xff\xfe")
    with pytest.raises(UserError, match=r"image\.toml: this is not UTF-8 text"):
        read_tables(tmp_path / "image.toml")


def test_config_file_written_on_windows_is_read(tmp_path: Path) -> None:
    text = f"{MOUNT}lowest = 99\n{SURFACE}".replace("\n", "\r\n")
    (tmp_path / "w.toml").write_bytes(b"\xef\xbb\xbf" + text.encode())
    with pytest.raises(UserError, match=r"w\.toml:3: "):
        make_config(*read_tables(tmp_path / "w.toml"))


def test_every_config_key_of_the_mount_is_a_flag() -> None:
    given = {
        "baud": "19200",
        "site": "1,2",
        "mode": "eq-north",
        "equinox": "auto",
        "site-time": "never",
        "lowest": "1.5",
        "highest": "80",
        "sync-limit": "3",
        "guide-rate": "0.75",
        "park": "3,4",
        "latency": "1",
        "speed": "5",
    }
    for name, text in given.items():
        key = next(key for key in keys_of("mount") if key.name == name)
        mount = flags(f"--{name}", text).mount[0]
        value = getattr(mount, name.replace("-", "_"))
        assert value != key.default
        assert (",".join(f"{part:g}" for part in value) if key.is_list else str(value)) in (text, f"{text}.0")


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_config_refuses_nan_and_infinity_for_numeric_keys(tmp_path: Path, value: str) -> None:
    numbers = [key.name for key in keys_of("mount") if isinstance(key.default, float)] + ["lowest", "highest"]
    assert "sun" in numbers
    for name in numbers:
        with pytest.raises(UserError, match=f"{name}: {value}: write a number"):
            read(tmp_path, f"{MOUNT}{name} = {value}\n{SURFACE}")


def test_flags_override_the_config_file(tmp_path: Path) -> None:
    path = tmp_path / "gateway.toml"
    path.write_text(f"wait = true\n{MOUNT}lowest = 5\nhighest = 70\n{SURFACE}")
    parser = argparse.ArgumentParser()
    add_setting_flags(parser)
    config, source = load_config(parser.parse_args(["--config", str(path), "--lowest", "7", "--no-wait"]))
    assert (config.mount[0].lowest, config.mount[0].highest, config.wait) == (7.0, 70.0, False)
    assert source.origin_of(("mount", 0, "lowest")) == "--lowest"
    assert source.origin_of(("mount", 0, "highest")) == f"{path}:5"
    assert source.origin_of(("mount", 0, "speed")) is None


def test_surface_flag_takes_no_settings_from_the_config_file(tmp_path: Path) -> None:
    path = tmp_path / "gateway.toml"
    path.write_text(f"{MOUNT}{SURFACE}client = 'indi'\n")
    parser = argparse.ArgumentParser()
    add_setting_flags(parser)
    config, source = load_config(parser.parse_args(["--config", str(path), "--surface", "nexstar@tcp://:0"]))
    assert [(surface.at, surface.client) for surface in config.surface] == [("nexstar@tcp://:0", "auto")]
    assert source.origin_of(("surface", 0)) == "--surface"
    assert source.origin_of(("surface", 0, "client")) is None


def test_mount_flag_is_refused_with_a_config_of_several_mounts(tmp_path: Path) -> None:
    path = tmp_path / "gateway.toml"
    path.write_text(TWO + A + B)
    parser = argparse.ArgumentParser()
    add_setting_flags(parser)
    for words in (["--lowest", "7"], ["--mount", "nexstar@sim"], ["--surface", "lx200@tcp://:0"]):
        with pytest.raises(UserError, match=f"{words[0]}: .*several mounts"):
            load_config(parser.parse_args(["--config", str(path), *words]))
    assert load_config(parser.parse_args(["--config", str(path), "--log"]))[0].log


_WORD = st.text("abcdef-", min_size=1, max_size=4)
_VALUE = st.sampled_from(
    [
        "1", "-2.5", '"x"', "'#'", "true", '"""\n[a]\nb = 1\n"""', "'''x\n\n'''", "[\n  1, # ]\n  2,\n]", "[]",
        "{a = 1}", "1979-05-27T07:32:00Z", '"\\u0041 = 3"',
    ]
)  # fmt: skip
_FILLER = st.lists(st.sampled_from(["", "# [x]", "   ", "# a = 1"]), max_size=2)
_KEYS = st.dictionaries(_WORD, st.tuples(_FILLER, _VALUE), max_size=4)
_TABLES = st.lists(st.tuples(st.booleans(), _WORD, _FILLER, _KEYS), max_size=5)


@examples(max_examples=as_a_rule(15, whole=40))
@given(_KEYS, _TABLES)
def test_every_config_key_is_located_on_its_line(
    first: dict[str, tuple[list[str], str]], tables: list[tuple[bool, str, list[str], dict[str, tuple[list[str], str]]]]
) -> None:
    """A document written line by line, so that every place is known, and read back by the parser."""
    lines: list[str] = []
    places: dict[tuple[str | int, ...], int] = {}

    def write(where: tuple[str | int, ...], held: dict[str, tuple[list[str], str]]) -> None:
        for key, (filler, value) in held.items():
            lines.extend(filler)
            places[(*where, key)] = len(lines) + 1
            lines.extend(f"{key} = {value}".split("\n"))

    write((), {f"k{key}": value for key, value in first.items()})
    seen: dict[str, int] = {}
    for several, word, filler, held in tables:
        name = f"{'s' if several else 't'}{word}"
        if not several and name in seen:
            continue
        lines.extend(filler)
        place = (name, seen.get(name, 0)) if several else (name,)
        seen[name] = seen.get(name, 0) + 1
        places[place] = len(lines) + 1
        lines.append(f"[[{name}]]" if several else f"[{name}]")
        write(place, held)
    text = "\n".join(lines)
    tomli.loads(text)
    assert {place: line_of(text, place) for place in places} == places
    assert line_of(text, ("nowhere",)) is None


def test_config_file_written_by_powershell_is_reported_as_utf_16(tmp_path: Path) -> None:
    for order in ("utf-16", "utf-16-be"):
        (tmp_path / "gateway.toml").write_bytes(("\ufeff" * (order != "utf-16") + MOUNT).encode(order))
        with pytest.raises(UserError, match="this is UTF-16"):
            read_tables(tmp_path / "gateway.toml")


@each(("mount", "surface"), [("nexstar", "lx200"), ("lx200", "nexstar")])
def test_missing_surface_is_reported_in_the_terms_of_the_file(tmp_path: Path, mount: str, surface: str) -> None:
    at = f"{surface}@tcp://127.0.0.1:4030"
    with pytest.raises(UserError, match=f'write \\[\\[surface\\]\\] into the file, and below it at = "{at}"$'):
        read(tmp_path, f"[mount]\nat = '{mount}@sim'\n")
    with pytest.raises(UserError, match=f"connect: --surface {at}$"):
        make_config({"mount": [{"at": f"{mount}@sim"}]}, Source("command line"))
