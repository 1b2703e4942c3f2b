"""Writes configurations from the keys: the configuration in effect, and a commented example."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from gateway.app.config.describing import Key, keys_of
from gateway.app.config.keys import SurfaceConfig
from gateway.app.config.programs import unmet_needs, with_needs
from gateway.app.config.source import Place, Source
from gateway.app.config.tables import Config


def effective_toml(config: Config, source: Source) -> str:
    """Return the configuration that ``run`` would use, as ``gateway.toml``, with the origin of changed values."""
    lines = ["# The configuration in effect. Values that are not defaults say where they come from.", ""]
    lines += [_line_for(key, getattr(config, key.name), source.origin_of((key.name,))) for key in keys_of("")]
    lines += ["", "[console]", *_table_lines("console", config.console, source, ("console",))]
    if config.mqtt is not None:
        lines += ["", "[mqtt]", *_table_lines("mqtt", config.mqtt, source, ("mqtt",))]
    for number, mount in enumerate(config.mount):
        lines += ["", "[mount]" if len(config.mount) == 1 else "[[mount]]"]
        lines += _table_lines("mount", mount, source, ("mount", number))
    for number, surface in enumerate(config.surface):
        lines += ["", "[[surface]]"]
        lines += _table_lines("surface", surface, source, ("surface", number))
    return "\n".join(lines) + "\n"


def _table_lines(table: str, struct: Any, source: Source, key_path: Place) -> Iterator[str]:
    by_program: dict[str, str] = {}
    if isinstance(struct, SurfaceConfig):
        by_program = {need.key: need.why for need in unmet_needs(struct)}
        struct = with_needs(struct)
    for key in keys_of(table):
        value = getattr(struct, key.name.replace("-", "_"))
        origin = source.origin_of((*key_path, key.name))
        if key.name == "at" and origin is None:
            origin = source.origin_of(key_path)
        if origin is None and key.name in by_program:
            origin = f"client {struct.client}: {by_program[key.name]}"
        yield _line_for(key, value, origin)


def _line_for(key: Key, value: Any, origin: str | None) -> str:
    if value is None:
        return f"# {key.name}: not set"
    changed = origin is not None and (value != key.default or key.required)
    return f"{key.name} = {to_toml(value)}" + (f"  # {origin}" if changed else "")


def example_toml() -> str:
    """Return an example ``gateway.toml`` with all keys; optional ones are commented out if not at their default."""
    lines = ["# gateway.toml: every key. A flag of the same name wins over the file.", ""]
    lines += _example_lines("")
    lines += [
        "",
        "# Several mounts: write [[mount]] for each, with a name, and the name in every [[surface]].",
        "[mount]",
        *_example_lines("mount"),
    ]
    lines += ["", "# The page that a browser shows.", "[console]", *_example_lines("console")]
    lines += ["", "# An MQTT broker that shows the mounts.", "#[mqtt]"]
    lines += [line if line.startswith("#") else f"#{line}" for line in _example_lines("mqtt")]
    lines += ["", "# One for each place where programs connect.", "[[surface]]", *_example_lines("surface")]
    return "\n".join(lines) + "\n"


def _example_lines(table: str) -> Iterator[str]:
    for key in keys_of(table):
        choice = f" ({', '.join(key.choices)})" if key.choices else ""
        yield f"# {key.description}{choice}"
        off = "" if key.required or key.example == key.default else "#"
        yield f"{off}{key.name} = {to_toml(key.example)}"


def to_toml(value: Any) -> str:
    """Return a value as TOML writes it."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(to_toml(part) for part in value)}]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value).lower()
