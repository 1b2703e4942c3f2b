"""This program: its version, and the folder that its package lies in."""

from __future__ import annotations

from pathlib import Path

VERSION = "0.1.0"
#: ``gateway/`` itself, in a checkout or where it is installed.
PACKAGE = Path(__file__).resolve().parents[1]
