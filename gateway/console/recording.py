"""The recording that a page begins and ends with a button: a file in the state folder, to be fetched by the browser.

It begins while the gateway runs, so it can be read, decoded and reported on; played again turn by turn is one that
``run --record`` has begun with the gateway itself.
"""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Any

from gateway.app.gateway import Gateway
from gateway.app.recording.recorded_gateway import record
from gateway.app.recording.recorder import Recorder
from gateway.core.errors import UserError
from gateway.system.files import directory

FOLDER = "recordings"
_NAME = re.compile(r"[\w.@-]+\.rec(\.\d+)?")


class Recording:
    """One recording at a time for every mount."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._recorder: Recorder | None = None
        self._path: Path | None = None
        self._since = 0.0

    @property
    def state(self) -> dict[str, Any] | None:
        """Its name and since when it runs; None where none runs."""
        if self._recorder is None or self._path is None:
            return None
        return {"name": self._path.name, "since": round(self._since)}

    def begin(self) -> str:
        """-> words. Raises UserError where the file cannot be written."""
        if self._recorder is not None:
            raise UserError("a recording is under way already; end it first")
        gateway = self._gateway
        folder = directory(gateway.config.state) / FOLDER
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"cannot record to {folder}: {error.strerror}") from None
        name = re.sub(r"[^\w-]", "_", gateway.config.name or gateway.mount.protocol)
        self._path = folder / f"{name}-{time.strftime('%Y%m%d-%H%M%S', time.gmtime(gateway.clock()))}.rec"
        self._recorder = record(self._path, gateway)
        self._since = gateway.clock()
        return f"recording to {self._path}"

    def end(self) -> Path:
        """-> the file. Raises UserError where none is written."""
        recorder, path = self._recorder, self._path
        if recorder is None or path is None:
            raise UserError("no recording is under way")
        self._gateway.wire_log.leave(recorder.put)
        recorder.close()
        self._recorder = None
        return path

    def file(self, name: str) -> Path | None:
        """A recording by its name; None where there is none of that name."""
        if not _NAME.fullmatch(name):
            return None
        path = directory(self._gateway.config.state) / FOLDER / name
        return path if path.is_file() else None
