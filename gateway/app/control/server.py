"""The gateway's control endpoint: requests arrive as datagrams, and each is answered once it has been carried out.

A request opens no file descriptor, so it works when none is left. A caller that missed the answer sends the request
again with the same number and gets the same answer, so nothing is carried out twice.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path
from typing import Any, cast

import msgspec

from gateway.app.control import exchange
from gateway.app.control.exchange import ControlEndpoint
from gateway.core.errors import Fault, NoAnswer
from gateway.core.requests import FAILED, Answer, Request, decode
from gateway.system.files import replace_file
from gateway.system.runtime_folders import protect_from_cleanup

#: How many requests are remembered, so that a repeated request gets the same answer.
MAX_REMEMBERED_REQUESTS = 64
SHUTDOWN = Answer(
    FAILED, "the gateway is shutting down and stops its mount; run the command again to be sure", NoAnswer.__name__
)

#: Request number -> the task that carries out the request.
Requests = dict[str, asyncio.Task[Answer]]


class ControlServer(asyncio.DatagramProtocol):
    """Receives requests for a mount, carries them out with ``carry_out``, and sends the answers.

    Endpoint files are written to ``folders``, the state folder first. They contain ``endpoint``, the mount's endpoint,
    and ``mount_name``, the name that its user gave it, or empty.
    """

    def __init__(
        self,
        folders: Sequence[Path],
        file_stem: str,
        endpoint: str,
        carry_out: Callable[[Request], Awaitable[Answer]],
        mount_name: str = "",
    ) -> None:
        self.endpoint_files = [folder / f"{file_stem}.{os.getpid()}{exchange.ENDPOINT_SUFFIX}" for folder in folders]
        self._state_folder = str(folders[0].absolute())
        self._endpoint, self._carry_out, self._mount_name = endpoint, carry_out, mount_name
        self._secret = os.urandom(16).hex()
        self._transport: asyncio.DatagramTransport | None = None
        self._tasks: Requests = {}
        self._open_descriptors: list[int] = []

    async def open(self) -> None:
        """Open a port and write endpoint files. Raises OSError if no port is free, or no file can be written."""
        for path in self.endpoint_files:
            with contextlib.suppress(OSError):
                exchange.remove_stale_files(path.parent)
        loop = asyncio.get_running_loop()
        transport, _ = await loop.create_datagram_endpoint(lambda: self, local_addr=("127.0.0.1", 0))
        self._transport = transport
        port = transport.get_extra_info("sockname")[1]
        endpoint = msgspec.json.encode(
            ControlEndpoint(self._endpoint, os.getpid(), port, self._secret, self._state_folder, self._mount_name)
        )
        failed: list[OSError] = []
        for path in self.endpoint_files:
            try:
                replace_file(path, endpoint, flush=False)
            except OSError as error:
                failed.append(error)
        if len(failed) == len(self.endpoint_files):
            raise failed[0]
        self._open_descriptors = [
            number for path in self.endpoint_files[1:] if (number := protect_from_cleanup(path.parent)) is not None
        ]

    def datagram_received(self, data: bytes, addr: object) -> None:
        """Begin a request, or answer a repeated one; ignore other datagrams, and requests if too many are under way."""
        message = exchange.verify(self._secret, data)
        if message is None or not message[1].startswith("ask "):
            return
        number, request_json = message[0], message[1].removeprefix("ask ")
        task = self._tasks.get(number)
        if task is None:
            if len(self._tasks) >= MAX_REMEMBERED_REQUESTS and not self._forget_done_task():
                return
            task = self._tasks[number] = asyncio.get_running_loop().create_task(self._answer_request(request_json))
        elif not task.done():
            self._send(number, exchange.WAIT_REPLY, addr)
            return
        self._send(number, exchange.WAIT_REPLY, addr)
        task.add_done_callback(lambda done: self._reply(number, SHUTDOWN if done.cancelled() else done.result(), addr))

    def error_received(self, exc: Exception) -> None:
        """Ignore the error: it means that a caller has ended."""

    def _forget_done_task(self) -> bool:
        """Forget the oldest request that is done; return False if none is done."""
        old = next((number for number, task in self._tasks.items() if task.done()), None)
        if old is None:
            return False
        del self._tasks[old]
        return True

    async def _answer_request(self, request_json: str) -> Answer:
        try:
            request = decode(request_json)
        except ValueError:
            return Answer(FAILED, "the gateway has another version than this command, and does not understand it")
        try:
            return await self._carry_out(request)
        except asyncio.CancelledError:
            return SHUTDOWN
        except Fault as fault:
            return Answer(FAILED, str(fault), type(fault).__name__)
        except Exception as error:  # a defect must not look like a gateway that has ended
            return Answer(FAILED, f"internal error, please report it: {error!r}")

    def _reply(self, request_number: str, answer: Answer, addr: object) -> None:
        for part in exchange.to_datagrams(msgspec.json.encode(answer).decode()):
            self._send(request_number, part, addr)

    def _send(self, request_number: str, text: str, addr: Any) -> None:
        if self._transport is not None and not self._transport.is_closing():
            self._transport.sendto(exchange.sign(self._secret, request_number, text), addr)

    async def close(self) -> None:
        """Delete the endpoint files, answer the callers that still wait, and close the port."""
        for path in self.endpoint_files:
            with contextlib.suppress(OSError):
                path.unlink(missing_ok=True)
        while self._open_descriptors:
            os.close(self._open_descriptors.pop())
        if self._transport is None:
            return
        waiting = [task for task in self._tasks.values() if not task.done()]
        for task in waiting:
            task.cancel()
        if waiting:
            await asyncio.wait(cast("list[asyncio.Task[object]]", waiting), timeout=1.0)
            await asyncio.sleep(0)
        self._transport.close()
        self._transport = None
