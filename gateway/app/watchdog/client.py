"""The gateway's side of the watchdog: starts the process, passes it the serial lines, and reports which mounts move.

Every message is one line of ASCII, with texts and commands in hexadecimal. A mount is added by ``line NUMBER TITLE
LOCK``, with a duplicate of its descriptor, or by ``server NUMBER TITLE LOCK HOST PORT WHEN`` (see ``ServedMount``).
``gone NUMBER`` removes it. ``moving NUMBER COMMAND…`` gives the commands that stop a moving mount;
``clear NUMBER COMMAND…`` replaces it if the motion is only a goto on a path within the limits. ``rest NUMBER`` means
that the mount is at rest. ``beat`` is the heartbeat, sent only while a mount moves; it costs no exchange with a mount.
The process sends ``stopped NUMBER`` after it has stopped a mount.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import socket
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from gateway.system.own_commands import script_argv

#: Seconds between two heartbeats.
HEARTBEAT_PERIOD = 0.25
#: A process that ended within so many seconds after its start is not restarted.
MIN_LIFETIME = 1.0
PROCESS_SCRIPT = Path(__file__).with_name("process.py")
#: Signals that end or suspend the gateway; they are blocked in the watchdog process from its start.
BLOCKED_SIGNALS = [
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP")
    if hasattr(signal, name)  # Windows has two of them, and no watchdog
]
#: The descriptor of the socket in the watchdog process.
SOCKET_DESCRIPTOR = 3
#: The kind and the commands of the last message about a mount that does not move.
REST_MESSAGE: tuple[str, tuple[bytes, ...]] = ("rest", ())


def is_available() -> bool:
    """Whether this system can pass the descriptor of a line to another process."""
    return hasattr(os, "posix_spawn") and hasattr(socket, "send_fds")


class Watchdog:
    """The watchdog process of this gateway. ``warn`` gets a message if it cannot be kept running.

    It is started by ``start``, or by the first motion: at the gateway's start it would delay the first reply by 10 %.
    """

    def __init__(self, warn: Callable[[str], None] = lambda text: None) -> None:
        self.warn = warn
        self._mounts: list[WatchedMount] = []
        self._heartbeat_timer: asyncio.TimerHandle | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._started_at: float | None = None
        self._connection: socket.socket | None = None
        self.pid: int | None = None

    def start(self) -> None:
        """Start the process and report every mount to it, unless it was started before."""
        if self._started_at is None:
            self._run()

    def _run(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._started_at = self._loop.time()
        self._spawn()
        if self._connection is not None:
            self._loop.add_reader(self._connection.fileno(), self._on_readable)
        for mount in self._mounts:
            mount.register()

    def _spawn(self) -> None:
        """Start the process. If that fails, warn and run without a watchdog."""
        ours, theirs = socket.socketpair()
        ours.setblocking(False)
        arguments = [*script_argv(str(PROCESS_SCRIPT)), str(SOCKET_DESCRIPTOR), str(os.getpid())]
        files = [(os.POSIX_SPAWN_OPEN, number, os.devnull, os.O_RDWR, 0) for number in (0, 1)]
        try:
            self.pid = os.posix_spawn(
                sys.executable,
                arguments,
                os.environ,
                file_actions=[*files, (os.POSIX_SPAWN_DUP2, theirs.fileno(), SOCKET_DESCRIPTOR)],
                setsigmask=BLOCKED_SIGNALS,
            )
            self._connection = ours
        except OSError as error:
            ours.close()
            self.warn(
                f"the watchdog process cannot be started ({error}): a gateway that is killed leaves its mount "
                "moving until mount-gateway stop is run"
            )
        finally:
            theirs.close()

    def watch(
        self,
        title: str,
        lock: Path | None,
        stop_commands: Callable[[], Sequence[bytes]],
        busy: Callable[[], bool],
        on_stopped: Callable[[], None],
        path_is_clear: Callable[[], bool] = lambda: False,
    ) -> WatchedMount:
        """Add a mount to be watched. See ``WatchedMount``."""
        number = len(self._mounts)
        self._mounts.append(WatchedMount(self, number, title, lock, stop_commands, busy, on_stopped, path_is_clear))
        return self._mounts[-1]

    def send(self, text: str, descriptors: Sequence[int] = ()) -> None:
        """Send a message to the process without waiting; if its buffer is full, the message is dropped."""
        if self._connection is not None:
            with contextlib.suppress(OSError):
                socket.send_fds(self._connection, [f"{text}\n".encode()], list(descriptors))

    def start_heartbeats(self) -> None:
        """Send heartbeats from now on, as long as any mount moves."""
        if self._heartbeat_timer is None and self._loop is not None:
            self._heartbeat_timer = self._loop.call_later(HEARTBEAT_PERIOD, self._on_beat)

    def _on_beat(self) -> None:
        self._heartbeat_timer = None
        moving = [mount for mount in self._mounts if mount.moving]
        for mount in moving:
            mount.report_changes()
        if any(mount.moving for mount in moving):
            self.send("beat")
            self.start_heartbeats()

    def _on_readable(self) -> None:
        """Read the messages of the process, or notice that it has ended."""
        assert self._connection is not None and self._loop is not None
        try:
            data = self._connection.recv(4096)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._on_process_end()
            return
        for line in data.decode("ascii").splitlines():
            self._mounts[int(line.rpartition(" ")[2])].on_watchdog_stop()

    def _on_process_end(self) -> None:
        """Restart the process after it was killed, unless it ended right after its start."""
        assert self._loop is not None and self._started_at is not None
        self._disconnect()
        if self._loop.time() - self._started_at < MIN_LIFETIME:
            self.warn(
                "the watchdog process has ended: a gateway that is killed leaves its mount moving "
                "until mount-gateway stop is run"
            )
            return
        self._run()

    def _disconnect(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            if self._loop is not None:
                self._loop.remove_reader(connection.fileno())
            connection.close()
        if self.pid is not None:
            with contextlib.suppress(OSError):
                os.waitpid(self.pid, os.WNOHANG)

    def close(self) -> None:
        """End the watchdog, which first stops every mount that still moves."""
        if self._heartbeat_timer is not None:
            self._heartbeat_timer.cancel()
        for mount in self._mounts:
            mount.report_changes()
        self._disconnect()


class WatchedMount:
    """One mount that the watchdog process stops if this process cannot.

    ``stop_commands`` returns the bytes that stop it now, ``busy`` whether it may be moving; ``on_stopped`` is
    called when the process has stopped the mount because heartbeats were missing; ``path_is_clear`` returns whether the
    only motion is a goto on a path within the limits. ``lock`` is the file that names the gateway that has the mount.
    """

    def __init__(
        self,
        watchdog: Watchdog,
        number: int,
        title: str,
        lock: Path | None,
        stop_commands: Callable[[], Sequence[bytes]],
        busy: Callable[[], bool],
        on_stopped: Callable[[], None],
        path_is_clear: Callable[[], bool],
    ) -> None:
        self._watchdog, self._mount_number, self._title, self._lock = watchdog, number, title, lock
        self._stop_commands, self._busy, self._on_stopped, self._clear = stop_commands, busy, on_stopped, path_is_clear
        self._line_descriptor: int | None = None
        self._server_fields: tuple[str, ...] = ()
        self._last_message: tuple[str, tuple[bytes, ...]] = REST_MESSAGE
        self.moving = False

    def opened(self, descriptor: int) -> None:
        """Pass the descriptor of the open line to the process."""
        self._line_descriptor = descriptor
        self.register()

    def reached(self, host: str, port: int, answers_in_parallel: bool) -> None:
        """Pass the address of the mount's server to the process, and whether the process may connect in advance."""
        self._server_fields = host, str(port), "beside" if answers_in_parallel else "alone"
        self.register()

    def closed(self) -> None:
        """Withdraw the line or server from the process, which closes its duplicate: the line is about to be closed."""
        self._line_descriptor, self._server_fields = None, ()
        self._watchdog.send(f"gone {self._mount_number}")

    def register(self) -> None:
        """Send the line's descriptor or the server's address to the process, and the stop commands if it moves."""
        if self._line_descriptor is not None or self._server_fields:
            kind, files = ("server", []) if self._line_descriptor is None else ("line", [self._line_descriptor])
            parts = (self._title, str(self._lock or ""), *self._server_fields)
            self._watchdog.send(
                f"{kind} {self._mount_number} {' '.join(word.encode().hex() or '00' for word in parts)}", files
            )
            self._last_message = REST_MESSAGE
            if self.moving:
                self.report_changes()

    def report_motion_start(self) -> None:
        """Start the process if needed, report to it that a motion is about to begin, and start the heartbeats."""
        self._watchdog.start()
        self.moving = True
        self._report()
        self._watchdog.start_heartbeats()

    async def before_motion(self) -> None:
        """Do what ``report_motion_start`` does, without waiting. It is called before each motion."""
        self.report_motion_start()

    def report_changes(self, _: None = None) -> None:
        """Check whether the mount still moves, and send its stop commands again if they have changed."""
        if self.moving:
            self.moving = self._busy()
            self._report()

    def _report(self) -> None:
        commands = tuple(self._stop_commands()) if self.moving else ()
        kind = ("clear" if self._clear() else "moving") if commands else "rest"
        if (kind, commands) != self._last_message:
            self._last_message = kind, commands
            text = "".join(f" {command.hex()}" for command in commands)
            self._watchdog.send(f"{kind} {self._mount_number}{text}")

    def on_watchdog_stop(self) -> None:
        """Call ``on_stopped``, because the process has stopped the mount."""
        self._last_message = REST_MESSAGE
        self._on_stopped()
