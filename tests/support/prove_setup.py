"""A simulated mount that ``prove`` checks: a whole gateway, on virtual time, and a person.

The person answers every question with the next of ``answers`` (then ``y``), and does what ``when`` says as soon as a
line or a progress holds its words. ``python -m tests.support.prove_setup`` writes the files of simulated mounts anew
that docs/prove.md lists.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import suppress
from pathlib import Path
from typing import Any
from unittest.mock import patch

from gateway.app.config import MountConfig, parse_endpoint
from gateway.app.gateway import Gateway
from gateway.app.simulated import DEFAULT_SITE, make_simulator
from gateway.core.wire_log import WireLog
from gateway.diagnostics.prove import small_motions
from gateway.diagnostics.prove.findings import Finding, Findings, write_proof_file
from gateway.diagnostics.prove.guide import GuidedCheck
from gateway.diagnostics.virtual_time import VirtualLoop, run
from gateway.mount.link.line import MountLink
from gateway.protocols.mechanics.truth import Truth, sample
from gateway.transport.wires import SimulatedTransport
from tests.support.owner import Owner

#: 2026-01-15 22:00 UTC
EVENING = 1768514400.0
CHECKED = Path(__file__).parents[2] / "docs" / "checked"
#: One mount of each kind: Celestrons with old and new hand controls, two of SynScan, the four Meades, three
#: controllers that speak LX200 with words of their own, and the three kinds of Alpaca.
KINDS = (
    "nexstar:6-8se", "nexstar:nexstar-gps/2.2", "nexstar:cgem", "nexstar:avx/starsense-1.19", "nexstar:synscan",
    "nexstar:synscan-az", "lx200:lx200", "lx200:lx200-16", "lx200:autostar", "lx200:lx200gps", "lx200:onstep",
    "lx200:teenastro", "lx200:other", "alpaca:german", "alpaca:altaz", "alpaca:polar",
)  # fmt: skip


class CalmLoop(VirtualLoop):
    """An event loop on virtual time that wakes ``late`` by so many seconds."""

    late = 1e-5

    def _wait(self) -> None:
        super()._wait()
        self.elapsed += self.late


class Onlooker:
    """A person who looks on; ``said`` is all that was shown, ``asked`` the questions."""

    def __init__(self, answers: str = "", when: dict[str, Callable[[], object]] | None = None) -> None:
        self.stop, self.said, self.asked = asyncio.Event(), list[str](), list[str]()
        self._answers, self.when = list(answers), dict(when or {})

    def _meet(self, text: str) -> None:
        for words in [words for words in self.when if words in text]:
            self.when.pop(words)()

    def say(self, text: str) -> None:
        self.said.append(text)
        self._meet(text)

    def show_progress(self, part: float, what: str) -> None:
        assert 0.0 <= part <= 1.0
        self._meet(what)

    async def ask_for_key(self, question: str, keys: str) -> str:
        self.asked.append(question)
        if self.stop.is_set():
            return " "
        key = self._answers.pop(0) if self._answers else "y"
        assert key in keys
        return key


class Proven:
    """``findings`` of a check of a simulated mount; ``truths`` are samples of what it really did."""

    def __init__(
        self,
        mount: str = "nexstar:6-8se",
        latency: float = 0.03,
        site: tuple[float, float] = DEFAULT_SITE,
        start: float = EVENING,
        config: dict[str, Any] | None = None,
        every: float = 0.5,
        change: Callable[[Proven], None] = lambda proven: None,
        **simulated: Any,
    ) -> None:
        self.loop = asyncio.get_running_loop()
        assert isinstance(self.loop, CalmLoop)
        loop = self.loop
        began = loop.time()

        def clock() -> float:
            return start + loop.time() - began

        self.clock = clock
        settings = MountConfig(**({"at": f"{mount.partition(':')[0]}@sim", "sun": 40.0} | (config or {})))
        self.gateway = Gateway(settings, [], WireLog(clock), clock=clock)
        self.sim = make_simulator(parse_endpoint(f"{mount}@sim"), clock=clock, site=site, **simulated)
        self.wire = SimulatedTransport("sim", self.sim.connection, latency)
        self.truths: list[Truth] = []
        self._every, self._change = every, change
        self._sent: list[bytes] = []
        self.findings = Findings()
        self.session: asyncio.Future[Findings]

    async def __aenter__(self) -> Proven:
        self.gateway.prepare(lambda reply_rules, to: MountLink(self.wire, reply_rules, to))
        self.controller = self.gateway.controller
        self.gateway.wire_log.sinks.append(
            lambda entry: self._sent.append(entry.data) if (entry.side, entry.arrow) == ("mount", ">") else None
        )
        self._change(self)
        self.gateway.open_line()
        await self.gateway.models_presented.wait()
        await self.controller.site_read.wait()
        self.owner = Owner(self, self.gateway.mount.protocol)
        self._sampling = asyncio.ensure_future(sample(self.sim, self.truths.append, self._every))
        return self

    async def __aexit__(self, *_: object) -> None:
        self._sampling.cancel()
        with suppress(asyncio.CancelledError):
            await self._sampling
        await self.gateway.close()

    def sent(self) -> list[bytes]:
        """Return every request sent to the mount so far."""
        return self._sent

    async def check(self, person: Onlooker) -> Findings:
        guide = GuidedCheck(self.gateway, person, self.findings, lambda findings: None)
        self.findings = await guide.run()
        return self.findings

    def all(self) -> dict[str, Finding]:
        return {one.what: one for stage in self.findings.stages.values() for one in stage}


def run_calm(program: Coroutine[Any, Any, Any]) -> Any:
    """Run a coroutine on a calm loop."""
    return run(program, CalmLoop)


def checked(mount: str, keys: tuple[int, ...] = (9, 6, 1), **simulated: Any) -> Findings:
    """Check a simulated mount in every stage, its rates of these keys."""

    async def check() -> Findings:
        async with Proven(mount, every=9.0, **simulated) as proven:
            return await proven.check(Onlooker())

    with patch.object(small_motions, "RATE_KEYS", keys):
        findings: Findings = run_calm(check())
    return findings


if __name__ == "__main__":
    for kind in KINDS:
        print(write_proof_file(CHECKED, checked(kind), simulated=True))
