"""Shows the state of a running gateway: a line on the terminal, and the status that systemd gets.

Both use cached readings and cost the mount no exchange. Without a terminal and without systemd nothing is done.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
import time
from collections.abc import Coroutine, Sequence
from typing import TYPE_CHECKING, TextIO

from msgspec.structs import replace

from gateway.app.status import AverageRate, StatusLine, status_text
from gateway.diagnostics.log.as_json import format_warning
from gateway.system import streams
from gateway.system.systemd import expects_notifications, notify, watchdog_interval

if TYPE_CHECKING:
    from gateway.app.gateway import Gateway

#: Seconds between two updates, for the terminal and for systemd.
TERMINAL_PERIOD, SYSTEMD_PERIOD = 1.0, 5.0


class Screen:
    """Prints lines for the user, and below them, on a terminal, a status line that is rewritten in place. With
    ``prints_json`` warnings are JSON, like the log for programs, which uses the same stream.
    """

    def __init__(self, terminal: TextIO | None, night_colours: bool = False, prints_json: bool = False) -> None:
        self.terminal, self._prints_json = terminal, prints_json
        self._colours: dict[str, str] = {}
        if terminal is not None and night_colours:
            from gateway.diagnostics.log.layout import colours_of

            self._colours = colours_of(terminal, night_colours)
        self._status_length = 0

    @property
    def columns(self) -> int:
        """The maximum length of a line that does not wrap."""
        assert self.terminal is not None
        with contextlib.suppress(OSError, ValueError):
            return (os.get_terminal_size(self.terminal.fileno()).columns or 80) - 1
        return 79

    def show_status(self, text: str) -> None:
        """Rewrite the status line, unless another program is in the terminal's foreground."""
        if self.terminal is not None and _is_in_foreground(self.terminal):
            from gateway.diagnostics.log.layout import paint_line

            padding = min(self._status_length, self.columns) - len(text)
            self._write(f"\r{paint_line(text, 'program', self._colours)}{' ' * padding}")
            self._status_length = len(text)

    def clear(self) -> None:
        """Erase the status line, so that another line can be written in its place."""
        if self.terminal is not None and self._status_length:
            self._write(f"\r{' ' * min(self._status_length, self.columns)}\r")
            self._status_length = 0

    def _write(self, text: str) -> None:
        assert self.terminal is not None
        plain = text.encode(self.terminal.encoding, "replace").decode(self.terminal.encoding)
        with contextlib.suppress(OSError, ValueError):  # the terminal was closed
            self.terminal.write(plain)
            self.terminal.flush()

    def say(self, text: str) -> None:
        """Print a line on stdout."""
        self.clear()
        streams.print_line(text)

    def warn(self, text: str) -> None:
        """Print a warning on stderr; ignore errors, because a closed terminal must not keep a mount moving."""
        self.clear()
        if self._prints_json:
            streams.print_to_stderr(
                f"{streams.journal_prefix(streams.WARNING, sys.stderr)}{format_warning(time.time(), text)}"
            )
        else:
            streams.warn(text, streams.WARNING)


def find_terminal() -> TextIO | None:
    """Return stderr, else stdout, if it is a terminal on which a line can be rewritten; else None."""
    if os.environ.get("TERM") == "dumb":
        return None
    return next((stream for stream in (sys.stderr, sys.stdout) if stream.isatty()), None)


def _is_in_foreground(terminal: TextIO) -> bool:
    """Whether this program is in the terminal's foreground, not started with ``&``."""
    with contextlib.suppress(OSError, ValueError, AttributeError):  # not our terminal; Windows has no such thing
        return os.tcgetpgrp(terminal.fileno()) == os.getpgrp()
    return True


class StatusLines:
    """Makes one status line for all gateways, with the exchanges per second of each mount."""

    def __init__(self, gateways: Sequence[Gateway]) -> None:
        self._gateways = [(gateway, AverageRate()) for gateway in gateways]

    def line(self, columns: int | None = None) -> str:
        """Return the status of all gateways on one line, of at most ``columns`` characters (None: of any length)."""
        try:
            return status_text([status_line(gateway, rate) for gateway, rate in self._gateways], columns)
        except ValueError as error:  # a mount may report any value, and systemd's watchdog must be fed
            return str(error)[:columns]

    @property
    def all_io_running(self) -> bool:
        """Whether the I/O task of every mount's line still runs."""
        return all(gateway.controller.line.is_running for gateway, _ in self._gateways)


def status_line(gateway: Gateway, rate: AverageRate) -> StatusLine:
    """Return the values of a mount that the status line shows; ``rate`` averages its exchanges per second."""
    state = gateway.state()
    return replace(state.look, rate=rate.add_sample(state.now, state.reply_count))


def start_status_updates(gateways: Sequence[Gateway], screen: Screen) -> list[asyncio.Task[None]]:
    """Begin to update the terminal and systemd, if there are any; the caller must cancel the tasks at the end."""
    work: list[Coroutine[object, object, None]] = []
    if screen.terminal is not None:
        work.append(_update_terminal(StatusLines(gateways), screen))
    if expects_notifications():
        work.append(_update_systemd(StatusLines(gateways), screen))
    return [asyncio.ensure_future(coroutine) for coroutine in work]


async def _update_terminal(status_lines: StatusLines, screen: Screen) -> None:
    while True:
        await asyncio.sleep(TERMINAL_PERIOD)
        screen.show_status(status_lines.line(screen.columns))


async def _update_systemd(status_lines: StatusLines, screen: Screen) -> None:
    """Feed systemd's watchdog as long as this event loop and the I/O task of every line run, and report the status."""
    patience = watchdog_interval()
    said, was_running = "", True
    while True:
        states = []
        if patience is not None and status_lines.all_io_running:
            states.append("WATCHDOG=1")
        if was_running and not status_lines.all_io_running:
            was_running = False
            screen.warn("internal error: the mount I/O task has ended; restart the gateway and please report it")
        if (line := status_lines.line()) != said:
            said = line
            states.append(f"STATUS={line}")
        if states:
            notify(*states)
        await asyncio.sleep(SYSTEMD_PERIOD if patience is None else min(SYSTEMD_PERIOD, patience / 3))
