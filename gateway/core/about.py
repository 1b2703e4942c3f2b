"""The version of this program and the folder of its package."""

from __future__ import annotations

from pathlib import Path

VERSION = "0.1.0"
#: The folder ``gateway/``, in a checkout or as installed.
PACKAGE = Path(__file__).resolve().parents[1]
