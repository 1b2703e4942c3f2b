"""``replay``: a recording once more; do the clients receive the same bytes?"""

from __future__ import annotations

import argparse
from pathlib import Path

from gateway.cli.help import Commands
from gateway.system import streams


def add(commands: Commands) -> None:
    replay = commands.add_parser(
        "replay",
        help="play a recording of run --record again and compare",
        description="The recorded times are the clock, the recorded mount is the mount: every "
        "client must receive the bytes that it received then. Exit code 1 when not.",
        epilog="Example:\n  mount-gateway run --config gateway.toml --record night.rec\n"
        "  mount-gateway replay night.rec",
    )
    replay.add_argument("file", type=Path, metavar="FILE")
    replay.add_argument("--sim", action="store_true", help="ask a simulated mount instead, and show the conversation")
    replay.set_defaults(run=_replay)


def _replay(arguments: argparse.Namespace) -> int:
    from gateway.app.recording.format import read
    from gateway.diagnostics.replay.replaying import replay, replay_on_simulator
    from gateway.diagnostics.replay.told import in_words

    recording = read(arguments.file)
    if arguments.sim:
        streams.tolerate()
        replay_on_simulator(recording, print)
        if recording.cut:
            print(recording.cut)
        return 0
    outcome = replay(recording)
    for words in [*outcome.strayed[:10], *in_words(outcome.differences)]:
        print(words)
    if recording.cut:
        print(recording.cut)
    if outcome.differences and outcome.guessed:
        print(f"the order of events was guessed, so that what is different may be due to that: {outcome.guessed}")
    verdict = "the same bytes" if not outcome.differences else f"{len(outcome.differences)} were told something else"
    print(f"{outcome.clients} connections, {outcome.replies} replies, {outcome.requests} requests: {verdict}")
    return 1 if outcome.differences else 0
