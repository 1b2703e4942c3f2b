"""The arrow buttons that browser pages hold down to move a mount.

Every heartbeat of a page lists the arrows that it holds; all others are released. Every press has a number, so that a
message about an old press does not affect a newer press. The newest press on an axis moves it; the release of an older
press changes nothing. If a second page still holds the released arrow, the motion continues for that page.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Set
from functools import partial
from typing import NamedTuple

from gateway.app.gateway import Gateway
from gateway.core.operations import Direction
from gateway.core.requests import FAILED, Answer, PressKeyRequest, ReleaseKeyRequest, new_request_number


class ArrowPress(NamedTuple):
    """An arrow that is held down: number of its press, id of its request, rate (1 to 9), and loop time of the press.

    ``cancel_counts``: how many stops and gotos there were at the press. Another stop or goto ends the arrow's motion.
    """

    press_number: int
    request: str
    rate: int
    began_at: float
    cancel_counts: tuple[int, int]


async def _answer_already_ended() -> Answer:
    """Answer a change of rate for an arrow that is no longer held."""
    return Answer(FAILED, "This arrow is not held any more.")


class Arrows:
    """The arrows that a page holds on a mount; ``all_pages`` lists the ``Arrows`` of all pages on this mount."""

    def __init__(self, gateway: Gateway, client_name: str, all_pages: list[Arrows]) -> None:
        self._gateway, self._client_name, self._all_pages = gateway, client_name, all_pages
        self._controller = gateway.controller
        self._presses: dict[Direction, ArrowPress] = {}
        #: The number of the newest press.
        self._last_press_number = 0
        all_pages.append(self)

    def __bool__(self) -> bool:
        """Whether an arrow is held down."""
        return bool(self._presses)

    def press(self, direction: Direction, rate: int, press_number: int = 0) -> asyncio.Task[Answer]:
        """Press an arrow, and release others of its axis. If ``press_number`` (0: a new press) is held already, change
        only its rate; if it was released, fail. Return the task whose result is the gateway's answer.
        """
        held = self._presses.get(direction)
        if held is not None and 0 < press_number == held.press_number:
            held = held._replace(rate=rate)
        elif 0 < press_number <= self._last_press_number:
            return self._controller.spawn(_answer_already_ended())
        else:
            for other in [arrow for arrow in self._presses if arrow.axis == direction.axis]:
                self.release(other)
            self._last_press_number = max(self._last_press_number, press_number)
            held = ArrowPress(press_number, new_request_number(), rate, self._controller.now(), self._cancel_counts())
        self._presses[direction] = held
        return self._controller.spawn(self._move(direction, held))

    async def _move(self, direction: Direction, press: ArrowPress) -> Answer:
        request = PressKeyRequest(direction, press.rate, number=press.request, who=self._client_name)
        answer = await self._gateway.carry_out(request)
        if not answer.is_ok and (held := self._presses.get(direction)) is not None and held.request == press.request:
            del self._presses[direction]  # refused, or ended by something else: a stop, a limit, the mount
            self._send_release(press, page_is_lost=True)
        return answer

    def _send_release(self, press: ArrowPress, page_is_lost: bool) -> None:
        request = ReleaseKeyRequest(page_is_lost, number=press.request, who=self._client_name)
        self._controller.spawn(self._gateway.carry_out(request))

    async def renew_motions(self) -> None:
        """Order the motions of all held arrows again, so that they do not time out."""
        for direction, held in list(self._presses.items()):
            await self._move(direction, held)

    def release_all_but(self, held_presses: Set[tuple[Direction, int]]) -> None:
        """Release every arrow except these (direction, number of the press), as if the page had disconnected."""
        for direction, held in list(self._presses.items()):
            if (direction, held.press_number) not in held_presses:
                self.release(direction, page_is_lost=True)

    def release(self, direction: Direction | None = None, press_number: int = 0, page_is_lost: bool = False) -> None:
        """Release an arrow (None: all of them); with a ``press_number``, only if that press is still held.
        ``page_is_lost``: the user did not release it; then a motion that has not begun is dropped.
        """
        for released in list(self._presses) if direction is None else [direction]:
            held = self._presses.get(released)
            if held is not None and press_number in (0, held.press_number):
                del self._presses[released]
                on_refused = partial(self._send_release, held, True)
                any(page.take_over(released, held, on_refused) for page in self._all_pages)
                self._send_release(held, page_is_lost)

    def take_over(self, direction: Direction, released_press: ArrowPress, on_refused: Callable[[], None]) -> bool:
        """Continue a motion if this page has held the arrow longer than the page that has just released it, and no stop
        or goto came since. Return whether it continues. If the mount refuses, ``on_refused`` is called to end it.
        """
        held = self._presses.get(direction)
        if held is None or held.began_at > released_press.began_at or held.cancel_counts != self._cancel_counts():
            return False
        self._presses[direction] = held = held._replace(request=new_request_number())
        self._controller.spawn(self._continue_press(direction, held, on_refused))
        return True

    async def _continue_press(self, direction: Direction, press: ArrowPress, on_refused: Callable[[], None]) -> None:
        if not (await self._move(direction, press)).is_ok:
            on_refused()

    def _cancel_counts(self) -> tuple[int, int]:
        """Return how many stops and how many gotos were ordered since the gateway started."""
        wanted = self._controller.wanted.value
        return wanted.stop_count, wanted.goto_count

    def close(self) -> None:
        """Release all arrows: the page has disconnected."""
        self._all_pages.remove(self)
        self.release(page_is_lost=True)
