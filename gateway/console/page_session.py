"""The session of an open page: it sends the state, carries out requests, and ends motions when the page disconnects.

The session sends the page the publisher's messages, which all pages share, but only after the page has read the earlier
ones. So a slow, stalled or hidden page delays nothing and gets the newest state when it reads again. A page sends a
heartbeat twice a second, with the arrows that it holds; after 1.5 seconds without a message, all are released.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Sequence
from typing import Any, Protocol

from gateway.app.control import objects
from gateway.app.control.requests import explain, position_of_date
from gateway.astro.spherical import wrap180
from gateway.console import messages
from gateway.console.arrows import Arrows
from gateway.console.messages import Message
from gateway.console.mounts import Mounts
from gateway.console.shown.publisher import encode
from gateway.console.shown.view import COARSE_DECIMALS, coordinates, in_page_wording
from gateway.core.about import full_version
from gateway.core.errors import Fault, UserError
from gateway.core.operations import Direction
from gateway.core.requests import Answer, Named, StopRequest, Target
from gateway.core.waiting import BackgroundTasks
from gateway.mount.controller import MountController

#: How many names are suggested while the user types; the length of a night and the step between positions, seconds.
MAX_SUGGESTIONS, NIGHT_LENGTH, NIGHT_STEP = 12, 57600.0, 7200.0


async def look_up(controller: MountController, target: Target) -> dict[str, Any]:
    """Return the coordinates of a target, and whether the mount may go to it (``may``; if not, the reason ``why``).
    For a name, add the data of the object (fields of ``SkyObject``). Raises UserError for an unknown name, and Fault if
    the target is not on the sky or its position is unknown.
    """
    about: dict[str, Any] = {}
    if isinstance(target, Named):
        entry = await asyncio.to_thread(objects.find_object, target.name)
        about = {key: value for key, value in entry._asdict().items() if key != "where"}
        target = entry.where
    goal = await position_of_date(controller, target)
    fault = await controller.preview_goto(goal)
    why = "" if fault is None else in_page_wording(explain(fault, controller.policy.limits))
    return {**about, **coordinates(controller, goal), "may": fault is None, "why": why}


async def suggestions(text: str) -> list[str]:
    """Return names of objects that begin with the text typed so far."""
    return await asyncio.to_thread(objects.completions, text, MAX_SUGGESTIONS) if text.strip() else []


def night_positions(controller: MountController) -> dict[str, Any]:
    """Return the positions (RA, dec) of date of Sun and Moon, from 8 hours before local solar midnight to 8 after it.

    In the evening and at night this is the current night, in the daytime the next. ``begins`` is the time of the first
    position by the gateway's clock, Unix seconds (None while the site is unknown), ``step`` the interval in seconds.
    """
    derived = controller.astrometry
    site, sky, unix = derived.site_clock.site(), derived.sky, derived.site_clock.unix()
    if site is None:
        return {"begins": None}
    until = (180.0 - wrap180(derived.sidereal_time() - sky.sun(unix)[0])) / 15.0 * 3600.0
    begins = (until - 86400.0 if until > 57600.0 else until) - NIGHT_LENGTH / 2
    times = [unix + begins + part * NIGHT_STEP for part in range(round(NIGHT_LENGTH / NIGHT_STEP) + 1)]
    moon = (sky.moon(time, site.latitude, site.longitude) for time in times)
    return {"begins": round(controller.wire_log.clock() + begins), "step": NIGHT_STEP,
            "sun": [_round_position(sky.sun(time)) for time in times],
            "moon": [_round_position(place) for place in moon]}  # fmt: skip


def _round_position(position: Sequence[float]) -> tuple[float, float]:
    return round(position[0], COARSE_DECIMALS), round(position[1], COARSE_DECIMALS)


#: Seconds without a message until arrows are released; between two checks of that; between repeated motion orders.
ARROW_TIMEOUT, ARROW_CHECK_PERIOD, ARROW_REPEAT_PERIOD = 1.5, 0.2, 5.0
#: The maximum number of simultaneous requests of a page; a stop and a release are always accepted.
MAX_PAGE_REQUESTS = 32
READ_ONLY_MESSAGE = "This page only looks. Enter the pin to act; STOP needs none."


class Socket(Protocol):
    """The interface of a WebSocket that a page session uses."""

    def unread_byte_count(self) -> int:
        """Return how many bytes wait to be sent, because the browser does not read them."""

    async def send(self, text: str) -> None:
        """Send a message. Raises ConnectionError."""


class PageSession:
    """One open page: ``run`` sends to it until it disconnects, ``receive`` receives its messages."""

    def __init__(self, mounts: Mounts, socket: Socket, host: str, may_control: bool) -> None:
        self._mounts, self._socket, self._host, self._may_control = mounts, socket, host, may_control
        self._client_name = f"the console at {host}"
        self._loop = asyncio.get_running_loop()
        self._last_message_at = self._last_repeat_at = self._loop.time()
        self._last_sent_text = ""
        #: The number of the next row of the conversation; None while the page does not show it.
        self._next_row: int | None = None
        pairs = zip(mounts.gateways, mounts.arrows, strict=True)
        self._arrows = [Arrows(gateway, self._client_name, pages) for gateway, pages in pairs]
        self._tasks = BackgroundTasks()

    # --- sending ----------------------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Send the state until cancelled or disconnected; then release all arrows."""
        mounts, publisher = self._mounts, self._mounts.publisher
        publisher.add_page()
        guard = self._loop.create_task(self._watch_arrows())
        try:
            await self._send({"hello": {
                "version": full_version(), "act": self._may_control, "pin": bool(mounts.pin) and not self._may_control,
                "now": mounts.now(), "times": [list(mount.answer_times.samples) for mount in publisher.mounts],
            }})  # fmt: skip
            while True:
                if not self._socket.unread_byte_count():
                    await self._send_newest()
                await publisher.wait_for_message()
        finally:
            publisher.remove_page()
            self._show_conversation(False)
            for arrows in self._arrows:
                arrows.close()
            guard.cancel()
            self._tasks.cancel()

    async def _send_newest(self) -> None:
        """Send the newest state, then the newest rows of the conversation; nothing that the page already has."""
        publisher = self._mounts.publisher
        if publisher.message_text != self._last_sent_text:
            self._last_sent_text = publisher.message_text
            await self._socket.send(self._last_sent_text)
        if self._next_row is not None and self._next_row != publisher.row_count:
            rows, self._next_row = publisher.rows_since(self._next_row), publisher.row_count
            await self._send({"talk": rows})

    async def _send(self, value: Any) -> None:
        await self._socket.send(encode(value))

    async def _watch_arrows(self) -> None:
        """Release the arrows of a silent page, else repeat their motion orders. A stalled browser delays neither."""
        while True:
            await asyncio.sleep(ARROW_CHECK_PERIOD)
            now = self._loop.time()
            repeats = now - self._last_repeat_at > ARROW_REPEAT_PERIOD
            for arrows in filter(None, self._arrows):
                if now - self._last_message_at > ARROW_TIMEOUT:
                    arrows.release(page_is_lost=True)
                elif repeats:
                    self._last_repeat_at = now
                    self._tasks.spawn(arrows.renew_motions())

    # --- requests ---------------------------------------------------------------------------------------------------

    def receive(self, text: str | bytes) -> None:
        """Receive a message of the page. An invalid one is answered with an error, and only keeps arrows held."""
        self._last_message_at = self._loop.time()
        try:
            message = messages.decode(text, self._client_name)
        except ValueError as error:
            self._tasks.spawn(
                self._answer(messages.answer_number(text), False, f"the console does not understand this: {error}")
            )
            return
        request = message.request
        if isinstance(request, messages.Beat):
            for number, arrows in enumerate(self._arrows):
                arrows.release_all_but(
                    {(_direction(arrow.direction), arrow.press) for arrow in request.held if arrow.mount == number}
                )
            return
        if len(self._tasks) >= MAX_PAGE_REQUESTS and not isinstance(request, StopRequest | messages.ReleaseArrow):
            self._tasks.spawn(self._answer(message.answer_number, False, "too many requests at once; wait a moment"))
        else:
            self._tasks.spawn(self._carry_out(message, self._press_or_release(message)))

    def _press_or_release(self, message: Message) -> asyncio.Task[Answer] | None:
        """Press or release an arrow at once, in the order of the messages. Return the task that answers a press."""
        if not 0 <= message.mount_index < len(self._arrows):
            return None
        arrows, request = self._arrows[message.mount_index], message.request
        if isinstance(request, messages.ReleaseArrow):
            arrows.release(None if request.direction is None else _direction(request.direction), request.press)
        elif isinstance(request, messages.PressArrow) and self._may_control:
            return arrows.press(_direction(request.direction), request.rate, request.press)
        return None

    async def _carry_out(self, message: Message, press_task: asyncio.Task[Answer] | None = None) -> None:
        try:
            if press_task is None:
                await self._carry_out_request(message)
            else:
                await self._send_answer(message, await press_task)
        except (UserError, Fault) as error:
            await self._answer(message.answer_number, False, str(error))
        except ConnectionError:
            pass
        except Exception as error:  # a defect must not leave the user without an answer
            self._mounts.gateways[0].wire_log.note("console", f"internal error, please report it: {error!r}")
            await self._answer(message.answer_number, False, f"internal error, please report it: {error!r}")

    async def _carry_out_request(self, message: Message) -> None:
        mounts, request = self._mounts, message.request
        if isinstance(request, StopRequest):
            chosen = mounts.gateways if message.mount_index == -1 else [mounts.gateway(message.mount_index)]
            answers = await asyncio.gather(*(gateway.carry_out(request) for gateway in chosen))
            reason = "; ".join(dict.fromkeys(answer.text for answer in answers))
            await self._answer(message.answer_number, all(answer.is_ok for answer in answers), reason)
            return
        gateway = mounts.gateway(message.mount_index)
        if not self._may_control and not isinstance(request, messages.ReadOnlyRequest):
            await self._answer(message.answer_number, False, READ_ONLY_MESSAGE)
            return
        match request:
            case messages.Talk():
                self._show_conversation(request.on)
            case messages.EnterPin():
                self._may_control = self._may_control or mounts.pin.admits(request.pin, self._host)
                reason = "this page may act now" if self._may_control else "this is not the pin"
                await self._answer(message.answer_number, self._may_control, reason)
            case messages.ReleaseArrow() | messages.PressArrow():  # the outcome of a press is answered elsewhere
                await self._answer(message.answer_number, True, "let go")
            case messages.LookUp():
                await self._answer(message.answer_number, True, "", await look_up(gateway.controller, request.where))
            case messages.Search():
                await self._answer(message.answer_number, True, "", {"found": await suggestions(request.text)})
            case messages.ShowNight():
                await self._answer(message.answer_number, True, "", night_positions(gateway.controller))
            case messages.Explain():
                done, text = await mounts.explain(gateway, request.surface, request.command)
                await self._answer(message.answer_number, done, "" if done else text, {"text": text} if done else {})
            case messages.Record():
                await self._record(message, request.on)
            case messages.Beat():
                pass  # ``receive`` has done it
            case _:
                await self._send_answer(message, await gateway.carry_out(request))

    def _show_conversation(self, is_shown: bool) -> None:
        if is_shown != (self._next_row is not None):
            publisher = self._mounts.publisher
            publisher.change_listeners(1 if is_shown else -1)
            self._next_row = publisher.row_count if is_shown else None

    async def _record(self, message: Message, starts: bool) -> None:
        recording = self._mounts.recorders[message.mount_index]
        if starts:
            await self._answer(message.answer_number, True, recording.begin())
            return
        path = await recording.end()
        download = f"/recording/{message.mount_index}/{path.name}"
        more = {"download": download, "report": download.removesuffix(".rec") + ".html"}
        await self._answer(message.answer_number, True, f"the recording is in {path}", more)

    async def _send_answer(self, message: Message, answer: Answer) -> None:
        await self._answer(message.answer_number, answer.is_ok, in_page_wording(answer.text))

    async def _answer(self, number: int, is_ok: bool, text: str, extra_fields: dict[str, Any] | None = None) -> None:
        if number:
            with contextlib.suppress(ConnectionError):
                await self._send({"id": number, "ok": is_ok, "words": text, **(extra_fields or {})})


def _direction(arrow: messages.Arrow) -> Direction:
    return Direction[arrow.upper()]
