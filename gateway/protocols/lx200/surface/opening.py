"""What a program for a Meade may begin a connection with: bytes that are passed over, and whole commands."""

from __future__ import annotations

import re

BEGINNING = re.compile(rb"(?:[#\r\n\0 ?]|\x06|:[^#]*#|\$Q#)*", re.DOTALL)
