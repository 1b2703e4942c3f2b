"""What a program for hand controls may begin a connection with: bytes that are passed over, and well-formed commands.

Well formed is a tracking mode there is, digits and a comma, a time of day; the version does not matter. What is not
well formed, such as the first two bytes of TRACE, is no program's.
"""

from __future__ import annotations

import re

BEGINNING = re.compile(
    rb"""
    (?:
        [\#\r\n\0\ ?] | [EeZzVvJLMmtwhiplxyu] | K. | T[\0-\3]
      | [RBS] [0-9A-Fa-f]{4},[0-9A-Fa-f]{4} | [rbs] [0-9A-Fa-f]{8},[0-9A-Fa-f]{8}
      | P [\1-\10] .{6}
      | W [\0-\x5a][\0-\x3b][\0-\x3b][\0-\1] [\0-\xb4][\0-\x3b][\0-\x3b][\0-\1]
      | [HI] [\0-\x17][\0-\x3b][\0-\x3b] [\1-\x0c][\1-\x1f]. .[\0-\1]
    )*
    """,
    re.DOTALL | re.VERBOSE,
)
