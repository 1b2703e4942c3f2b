"""The parts that all pages share: the gateway's mounts, the publisher of their state, recordings, explanations.

A recording started by a page is a file in the state folder that the browser can download.
"""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gateway.app.gateway import Gateway
from gateway.app.recording.format import unescape
from gateway.app.recording.recorder import Recorder, record
from gateway.clients.any_protocol.deciding import find_protocol
from gateway.clients.strangers import IDLE_BYTES
from gateway.console.arrows import Arrows
from gateway.console.pin import Pin
from gateway.console.shown.publisher import Publisher
from gateway.core.errors import UserError
from gateway.core.operations import GetIdentity, Identity
from gateway.protocols.registry import ANY, PROTOCOLS, accepted_protocols
from gateway.protocols.wireformat.command_set import load
from gateway.system.files import state_folder
from gateway.system.own_commands import gateway_argv

#: The timeout for an explanation or a report in seconds; another process makes each.
EXPLAIN_TIMEOUT = 20.0
RECORDINGS_FOLDER = "recordings"
_RECORDING_NAME = re.compile(r"[\w.@-]+\.rec(\.\d+)?")


class Mounts:
    """The mounts of this gateway. A page must enter ``pin`` before it may control them; no PIN is needed if empty."""

    def __init__(self, gateways: Sequence[Gateway], pin: str = "") -> None:
        self.gateways = list(gateways)
        self.pin = Pin(pin, time.monotonic, lambda text: self.gateways[0].wire_log.note("console", text))
        self.recorders = [MountRecorder(gateway) for gateway in self.gateways]
        self.publisher = Publisher(self.gateways, lambda: [recording.state for recording in self.recorders])
        #: By mount, the arrows that each page holds.
        self.arrows: list[list[Arrows]] = [[] for _ in self.gateways]
        self._explain_lock = asyncio.Lock()

    def now(self) -> float:
        """Return the time by this computer's clock, Unix seconds."""
        return self.gateways[0].clock()

    def gateway(self, mount_index: int) -> Gateway:
        """Return the gateway of the mount with this number. Raises UserError if there is none."""
        if not 0 <= mount_index < len(self.gateways):
            raise UserError(f"there is no mount {mount_index} here")
        return self.gateways[mount_index]

    async def explain(self, gateway: Gateway, surface: str, command: str) -> tuple[bool, str]:
        """Run ``explain`` for a command on this mount in a subprocess, one at a time. Return (success, text)."""
        named = _surface_argument(surface or gateway.names()[0].partition("@")[0], command)
        argv = [*gateway_argv(), "explain", "--", named, _mount_argument(gateway), command]
        return await self._run_command(argv, "explanation")

    async def report(self, recording: Path) -> Path:
        """Write the report of a recording to its folder, in a subprocess. Return the path. Raises UserError."""
        target = recording.with_suffix(".html")
        done, text = await self._run_command(
            [*gateway_argv(), "report", "--force", "-o", str(target), str(recording)], "report"
        )
        if not done or not target.is_file():
            raise UserError(text.removeprefix("mount-gateway: "))
        return target

    async def _run_command(self, argv: Sequence[str], result_name: str) -> tuple[bool, str]:
        """Run a subcommand of mount-gateway, one at a time. Return (True, its output), or (False, why it has none)."""
        async with self._explain_lock:
            process = await asyncio.create_subprocess_exec(
                *argv, stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
            )
            try:
                async with asyncio.timeout(EXPLAIN_TIMEOUT):
                    out, err = await process.communicate()
            except TimeoutError:
                process.kill()
                await process.wait()
                return False, f"no {result_name} within {EXPLAIN_TIMEOUT:.0f} seconds; the command line waits longer"
        if not out:
            return False, err.decode("utf-8", "replace").strip() or f"no {result_name}"
        return True, out.decode("utf-8", "replace")


def _mount_argument(gateway: Gateway) -> str:
    """Return the mount as an argument of ``explain``; a model or version not configured is the reported one."""
    at = gateway.mount
    model, version = at.model, at.version
    identity: Identity | None = gateway.controller.cache.last_value(GetIdentity)
    if identity is not None and identity.model in load(at.protocol).models:
        model, version = model or identity.model, version or identity.version
    return at.protocol + (f":{model}" if model else "") + (f"/{version}" if model and version else "")


def _surface_argument(surface: str, command: str) -> str:
    """Return the surface as an argument of ``explain``; if it takes any protocol, return the command's protocol."""
    if surface != ANY:
        return surface
    sent = unescape(command).lstrip(IDLE_BYTES)
    verdict = find_protocol(sent) if sent else None
    return verdict.protocol if verdict is not None and verdict.protocol in PROTOCOLS else accepted_protocols(ANY)[0]


class MountRecorder:
    """The recordings of a mount, one at a time."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._recorder: Recorder | None = None
        self._path: Path | None = None
        self._started_at = 0.0

    @property
    def state(self) -> dict[str, Any] | None:
        """The file name and start time (Unix seconds) of the running recording; None if there is none."""
        if self._recorder is None or self._path is None:
            return None
        return {"name": self._path.name, "since": round(self._started_at)}

    def begin(self) -> str:
        """Start a recording and return a message. Raises UserError if one is running, or the file cannot be written."""
        if self._recorder is not None:
            raise UserError("a recording is running already; end it first")
        gateway = self._gateway
        folder = state_folder(gateway.config.state) / RECORDINGS_FOLDER
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"cannot record to {folder}: {error.strerror}") from None
        name = re.sub(r"[^\w-]", "_", gateway.config.name or gateway.mount.protocol)
        self._path = folder / f"{name}-{time.strftime('%Y%m%d-%H%M%S', time.gmtime(gateway.clock()))}.rec"
        self._recorder = record(self._path, gateway)
        self._started_at = gateway.clock()
        return f"recording to {self._path}"

    async def end(self) -> Path:
        """End the recording and return its path. Raises UserError if none is running."""
        recorder, path = self._recorder, self._path
        if recorder is None or path is None:
            raise UserError("no recording is running")
        self._gateway.wire_log.remove_sink(recorder.put)
        self._recorder = None
        await recorder.close()
        return path

    def recording_path(self, name: str) -> Path | None:
        """Return the path of the recording with this file name; None if there is none."""
        if not _RECORDING_NAME.fullmatch(name):
            return None
        path = state_folder(self._gateway.config.state) / RECORDINGS_FOLDER / name
        return path if path.is_file() else None
