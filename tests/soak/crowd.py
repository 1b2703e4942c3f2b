"""Many programs that poll a gateway's LX200 and NexStar ports. Standalone, and part of ``stop_latency.py``.

    python -m tests.soak.crowd LX200_PORT NEXSTAR_PORT [--clients 200] [--rate 4] [--seed 1]

Every second one sends ``:GR#:GD#`` in one write, the others ``e``. It runs until it is ended, and fails if a reply was
wrong in its form or did not come.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import random
import re
import sys

RATE = 4.0
PATIENCE = 5.0
#: A question, and the form of its reply.
QUESTIONS = (
    (b"e", re.compile(rb"[0-9A-F]{8},[0-9A-F]{8}#")),
    (b":GR#:GD#", re.compile(rb"\d\d:[0-5]\d:[0-5]\d#[+-]\d\d[*\xdf][0-5]\d[:'][0-5]\d#")),
)


class Crowd:
    """``wrong`` describes the replies that were wrong."""

    def __init__(self, rate: float) -> None:
        self.rate, self.answers, self.wrong = rate, 0, list[str]()

    async def client(self, port: int, question: bytes, form: re.Pattern[bytes], chance: random.Random) -> None:
        """Run one program for ever."""
        loop = asyncio.get_running_loop()
        began = loop.time()
        await asyncio.sleep(chance.uniform(0.0, 1.0 / self.rate))
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        due = loop.time()
        while True:
            writer.write(question)
            reply = b""
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(PATIENCE):
                    for _ in range(question.count(b"#") or 1):
                        reply += await reader.readuntil(b"#")
            self.answers += 1
            if not form.fullmatch(reply):
                self.wrong.append(f"{question!r} was answered {reply!r} after {loop.time() - began:.1f} s")
            due = max(due + 1.0 / self.rate, loop.time())
            await asyncio.sleep(due - loop.time())

    async def run(self, ports: tuple[int, int], clients: int, seed: int) -> None:
        """Run this many programs, until cancelled."""
        async with asyncio.TaskGroup() as group:
            for number in range(clients):
                kind = number % 2
                group.create_task(self.client(ports[kind], *QUESTIONS[kind], random.Random(f"{seed} {number}")))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lx200_port", type=int)
    parser.add_argument("nexstar_port", type=int)
    parser.add_argument("--clients", type=int, default=200)
    parser.add_argument("--rate", type=float, default=RATE, help="how often each asks, a second")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--idle", action="store_true", help="run at idle priority")
    arguments = parser.parse_args()
    if arguments.idle:  # it stands for other computers, which take no time from the gateway's
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    crowd = Crowd(arguments.rate)
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(crowd.run((arguments.nexstar_port, arguments.lx200_port), arguments.clients, arguments.seed))
    print(f"{crowd.answers} answers, {len(crowd.wrong)} wrong", *crowd.wrong[:10], sep="\n")
    return 1 if crowd.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
