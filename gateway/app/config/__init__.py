"""The user's settings: on the command line or in ``gateway.toml``, under the same names.

A key is declared and described once, in ``keys.py`` or ``tables.py``: the parser, the flag, ``--help``, the example and
the table of docs/configuration.md are derived from that. Mistakes are reported in one line: where, and what is right.
"""

from __future__ import annotations

from gateway.app.config.endpoints import Endpoint, parse_device, parse_endpoint, parse_site
from gateway.app.config.keys import MountConfig, SurfaceConfig
from gateway.app.config.reading import make_config, read_tables
from gateway.app.config.source import Source
from gateway.app.config.tables import Config

__all__ = [
    "Config",
    "Endpoint",
    "MountConfig",
    "Source",
    "SurfaceConfig",
    "make_config",
    "parse_device",
    "parse_endpoint",
    "parse_site",
    "read_tables",
]
