"""Brings the line into step again: what is on the wire is drained, then proofs are exchanged until all fit."""

from __future__ import annotations

import asyncio

from gateway.core.errors import Busy, Fault
from gateway.core.signals import Signal
from gateway.mount.link.transaction import QUIET, Transaction

#: How often the line is proven before it counts as down; after a proof that failed, so many times more quiet is wanted.
PROOFS, QUIETER = 3, 3.0


class Recovery:
    """``prove`` says whether it is in step; ``failed`` is emitted after each proof in vain, while the wire is there."""

    def __init__(self, talk: Transaction) -> None:
        self._talk = talk
        self._number = 0
        self.failed: Signal[None] = Signal()

    async def prove(self) -> bool:
        """Drain, then exchange proofs until the line is in step again -> whether it is."""
        talk = self._talk
        for attempt in range(PROOFS):
            await talk.drain(QUIET * QUIETER**attempt)
            if not talk.lost and await self.in_step():
                return True
            if talk.lost:
                return False
            self.failed.emit(None)
        return False

    async def in_step(self) -> bool:
        """Whether every proof is answered as it should be, and nothing follows."""
        talk = self._talk
        self._number += 1
        for ask in talk.dialogue.proof(self._number):
            await asyncio.sleep(talk.gap(ask))
            outcome = await talk.exchange(ask, proof=True)
            if isinstance(outcome, Busy):
                continue  # that is an answer, too
            if isinstance(outcome, Fault) or not talk.dialogue.proven(ask, outcome):
                return False
        return not await talk.drain(QUIET)
