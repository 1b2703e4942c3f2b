"""How a telescope writes is learnt from what it tells: marks, seconds, signs. Bytes as real telescopes send them."""

from __future__ import annotations

from gateway.protocols.lx200.reply_rules import Notation
from tests.support.each import each


@each(("answers", "command", "reply", "written"), [
    ({}, "GD", b"+45*10:20#", b"+45*10:20#"),
    ({"GD": b"+00\xdf00:00#"}, "GD", b"-45*10:20#", b"-45\xdf10:20#"),
    ({"GD": b"+00\xdf00:00#"}, "Gd", b"-45*10:20#", b"-45\xdf10:20#"),
    ({"GD": b"+00\xdf00:00#"}, "GD", b"+45*10#", b"+45\xdf10#"),
    ({"GD": b"+00:00:00#"}, "Gh", b"90*#", b"90:#"),
    ({"GD": b"+00\xdf00:00#", "GZ": b"180\xdf01'58#"}, "GZ", b"007*59:01#", b"007\xdf59'01#"),
    ({"GD": b"+00\xdf00:00#", "Gt": b"+45\xdf00:00#"}, "Gt", b"-33*52#", b"-33\xdf52:00#"),
    ({"GD": b"+00\xdf00:00#", "Gg": b"350\xdf00:00#"}, "Gg", b"-018*24#", b"341\xdf36:00#"),
    ({"GD": b"+00\xdf00:00#", "Gg": b"350\xdf00#"}, "Gg", b"+070*30#", b"070\xdf30#"),
    ({"GT": b"+60.0#"}, "GT", b"60.1#", b"+60.1#"),
    ({"GT": b"60.1#"}, "GT", b"57.9#", b"57.9#"),
    ({"GD": b"+00\xdf00:00#"}, "LI", b"M31 * GAL#", b"M31 * GAL#"),
])  # fmt: skip
def test_cached_lx200_reply_is_written_in_the_notation_of_the_telescope(
    answers: dict[str, bytes], command: str, reply: bytes, written: bytes
) -> None:
    notation = Notation()
    for name, answer in answers.items():
        notation.learn(name, answer)
    assert notation.write(command, reply) == written
