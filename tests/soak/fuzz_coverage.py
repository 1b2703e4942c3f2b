"""Coverage-guided fuzzing (atheris, on libFuzzer) of the framing and the parsing of both protocols. Standalone.

    python -m tests.soak.fuzz_coverage TARGET [libFuzzer's options, such as -max_total_time=600 -seed=1, and a corpus]

TARGET is lx200-framing, nexstar-framing, lx200-parsing or nexstar-parsing. Framing must not depend on how the bytes
were cut into packets; parsing takes client bytes through the surface to its replies, and mount bytes through the reply
rules to their fields. It begins with the conversations in ``tests``; without a corpus directory it saves nothing.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import atheris

from gateway.protocols.base.session import MountSettings

atheris.enabled_hooks.add("str")  # "RegEx" does not work with compiled modules such as tomli
with atheris.instrument_imports(include=["gateway"]):
    from gateway.core.errors import Fault
    from gateway.protocols.base.driver import Send
    from gateway.protocols.base.frames import Unterminated
    from gateway.protocols.lx200.framing import LONGEST, Framer
    from gateway.protocols.lx200.reply_rules import Lx200ReplyRules
    from gateway.protocols.nexstar.framing import Framer as Lengths
    from gateway.protocols.nexstar.framing import all_lengths
    from gateway.protocols.nexstar.reply_rules import NexStarReplyRules
    from tests.soak.fuzz_bytes import conversations
    from tests.soak.fuzz_forms import PROTOCOLS, of_reply
    from tests.support.fake_mount import Mount, Talk


Target = Callable[[bytes], None]
_MODELS = {"lx200": ["autostar", "lx200", "lx200-16", "lx200gps"], "nexstar": ["6-8se", "cge", "cgx", "cpc", "gt"]}
_REPLY_RULES: dict[str, Any] = {"lx200": Lx200ReplyRules(), "nexstar": NexStarReplyRules()}


def _pieces(data: bytes) -> list[bytes]:
    """Cut the bytes after the first one into pieces of the size that the first one gives."""
    size = 1 + data[0] % 16
    return [data[at : at + size] for at in range(1, len(data), size)]


def lx200_framing(data: bytes) -> None:
    """Frames must be whole commands, and the same ones for every way to cut the bytes."""
    if not data:
        return
    whole, cut = Framer(), Framer()
    frames = whole.feed(data[1:], 0.0)
    assert frames == [frame for piece in _pieces(data) for frame in cut.feed(piece, 0.0)]
    assert len(cut._frame) <= LONGEST
    for frame in frames:
        if isinstance(frame, Unterminated):
            assert len(frame) <= LONGEST + 1 and frame.names
            continue
        assert frame == b"\x06" or (frame[:1] in b":$" and frame.endswith(b"#") and 3 <= len(frame) <= LONGEST + 2)
        assert frame.count(b"#") <= 1 and not set(frame) & set(b"\r\n\0")


def nexstar_framing(data: bytes) -> None:
    """Frames must be as long as their first byte says, and the same ones for every way to cut the bytes."""
    if not data:
        return
    whole, cut = Lengths(), Lengths()
    frames = whole.feed(data[1:], 0.0)
    assert frames == [frame for piece in _pieces(data) for frame in cut.feed(piece, 0.0)]
    assert all(len(frame) == all_lengths()[frame[0]] for frame in frames)
    assert len(cut._pending) < 18


def _parsing(protocol: str) -> Target:
    """Take half of the inputs as bytes from a client, the others as replies from a mount."""
    faces = [Talk(model=model, protocol=protocol) for model in _MODELS[protocol]]
    commands = list(PROTOCOLS[protocol].commands)
    reply_rules = _REPLY_RULES[protocol]

    def replies(ask: Send, buffer: bytes) -> None:
        try:
            taken = reply_rules.take(ask, buffer)
        except ValueError:
            return  # the link calls this a garbled reply
        if taken is not None:
            outcome, length = taken
            assert isinstance(outcome, Fault | dict)
            assert 0 <= length <= len(buffer)
            assert length or not PROTOCOLS[protocol].commands[ask.command].replies

    def parse(data: bytes) -> None:
        if len(data) < 3:
            return
        if data[0] & 0x80:
            replies(Send(commands[data[1] % len(commands)]), data[2:])
            return
        talk = faces[data[0] % len(faces)]
        talk.mount, talk.deferred = Mount(), []
        talk.mount.fault = Fault() if data[1] == 0xFF else None
        talk.now = talk.mount.clock.unix
        talk.session.common.settings = MountSettings()
        talk.session.forget()
        for frame in talk.binding.framing().feed(data[2:], talk.now):
            reply = talk._handle(frame)
            verdict = of_reply(PROTOCOLS[protocol], frame, reply) if reply else ""
            assert not verdict, (frame, verdict)
            talk.session.last = frame
        with suppress(Fault):  # the client's wire log reports it
            talk.wait(3.0)

    return parse


def main() -> None:
    """Run one target; libFuzzer ends the process."""
    name, *options = sys.argv[1:] or [""]
    protocol, _, part = name.partition("-")
    if protocol not in PROTOCOLS or part not in ("framing", "parsing"):
        sys.exit(__doc__)
    target = _parsing(protocol) if part == "parsing" else {"lx200": lx200_framing, "nexstar": nexstar_framing}[protocol]
    seeds = Path(tempfile.mkdtemp(prefix="fuzz-seeds-"))
    for number, packet in enumerate(sorted(set(conversations(protocol)))):
        (seeds / str(number)).write_bytes(b"\0\0"[: 2 if part == "parsing" else 1] + packet[:250])
    directories = [option for option in options if not option.startswith("-")] or [tempfile.mkdtemp(prefix="fuzz-")]
    flags = [option for option in options if option.startswith("-")]
    atheris.Setup([sys.argv[0], "-max_len=256", "-print_final_stats=1", *flags, *directories, os.fspath(seeds)], target)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
