"""The keys of the configuration as data: for flags, messages, the example and the documentation."""

from __future__ import annotations

import types
from collections.abc import Iterator
from functools import lru_cache
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

import msgspec

from gateway.app.config.tables import TABLES


class Key(NamedTuple):
    """A key of the configuration. ``allowed`` describes the valid values; ``choices`` lists those that are words."""

    name: str
    description: str
    metavar: str
    allowed: str
    choices: tuple[str, ...]
    value_type: object
    default: object
    example: object
    has_flag: bool
    #: Whether ``run --help`` shows its flag; ``run --help all`` shows every flag.
    in_short_help: bool
    required: bool
    #: Whether the value is a list, which is separated by commas in a flag.
    is_list: bool

    @property
    def help(self) -> str:
        """The description, followed by the default if it is a number or a word."""
        if self.default is None or isinstance(self.default, bool | list):
            return self.description
        shown = f"{self.default:g}" if isinstance(self.default, float) else self.default
        return f"{self.description} (default {shown})"


@lru_cache
def keys_of(table: str) -> tuple[Key, ...]:
    """Return the keys of a table such as ``mount`` or ``surface``; those outside any table for an empty name."""
    struct = TABLES[table]
    hints = get_type_hints(struct, include_extras=True)
    return tuple(_key(field, hints[field.name]) for field in msgspec.structs.fields(struct) if _meta(hints[field.name]))


def header_of(table: str) -> str:
    """Return the header of a table as the file writes it; for an empty name, words for the lines before any table."""
    return {"surface": "[[surface]]", "": "the first lines of the file"}.get(table, f"[{table}]")


def find_key(table: str, name: str) -> Key | None:
    """Return the key of that name in a table; None if there is none."""
    return next((key for key in keys_of(table) if key.name == name), None)


def _key(field: Any, type_hint: Any) -> Key:
    meta = _meta(type_hint)
    assert meta is not None and meta.extra is not None
    kind, choices, allowed = get_args(type_hint)[0], _choices_of(type_hint), _describe_values(type_hint)
    default = None if field.required else field.default
    if field.default_factory is not msgspec.NODEFAULT:
        default = field.default_factory()
    return Key(
        name=field.encode_name,
        description=meta.description or "",
        metavar=meta.extra["shown"] or "|".join(choices),
        allowed=allowed,
        choices=choices,
        value_type=Annotated[kind, meta],
        default=default,
        example=default if meta.extra["example"] is None else meta.extra["example"],
        has_flag=meta.extra["flag"],
        in_short_help=meta.extra["common"],
        required=field.required,
        is_list=any(get_origin(part) in (tuple, list) for part, _ in _types_of(type_hint)),
    )


def _meta(type_hint: object) -> msgspec.Meta | None:
    """Return the msgspec metadata with which a key was declared; None for a field that is no key."""
    return next((item for item in getattr(type_hint, "__metadata__", ()) if item.extra is not None), None)


def _types_of(type_hint: object) -> Iterator[tuple[object, list[msgspec.Meta]]]:
    """Yield the types that a value may have, except None, each with its limits."""
    if get_origin(type_hint) is Annotated:
        inner, *metas = get_args(type_hint)
        for kind, more in _types_of(inner):
            yield kind, [*metas, *more]
    elif get_origin(type_hint) in (Union, types.UnionType):
        for part in get_args(type_hint):
            yield from _types_of(part)
    elif type_hint is not type(None):
        yield type_hint, []


def _choices_of(type_hint: object) -> tuple[str, ...]:
    return tuple(word for kind, _ in _types_of(type_hint) if get_origin(kind) is Literal for word in get_args(kind))


def _describe_values(type_hint: object) -> str:
    """Return a description of the valid values."""
    return " or ".join(_valid_values(kind, metas) for kind, metas in _types_of(type_hint))


def _valid_values(kind: object, meta_values: list[msgspec.Meta]) -> str:
    if get_origin(kind) is Literal:
        return f"one of {', '.join(get_args(kind))}"
    if get_origin(kind) is tuple:
        return f"[{', '.join(_describe_values(part) for part in get_args(kind))}]"
    if get_origin(kind) is list:
        return f"a list, each {_describe_values(get_args(kind)[0])}"
    if kind is bool:
        return "true or false"
    if kind in (int, float):
        return ("a whole number" if kind is int else "a number") + _range_of(meta_values)
    return f'{next((meta.title for meta in meta_values if meta.title), "text")} in "quotes"'


def _range_of(meta_values: list[msgspec.Meta]) -> str:
    """Return the limits as text: `` from 1 to 9``."""
    limits: dict[str, object] = {}
    for meta in meta_values:
        limits |= {name: getattr(meta, name) for name in ("ge", "gt", "le", "lt") if getattr(meta, name) is not None}
    low = f" from {limits['ge']:g}" if "ge" in limits else f" more than {limits['gt']:g}" if "gt" in limits else ""
    high = f" to {limits['le']:g}" if "le" in limits else f" below {limits['lt']:g}" if "lt" in limits else ""
    return low + (" and up" if low and "gt" in limits and high else "") + high
