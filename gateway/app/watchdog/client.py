"""The gateway's side of the watchdog: it starts the process, passes it the serial lines, and tells it what moves.

Every message is one line of ASCII: ``line NUMBER TITLE LOCK``, sent with a duplicate of the line's descriptor; ``gone
NUMBER``; ``moving NUMBER COMMAND…`` with what stops the mount; ``rest NUMBER``; and ``beat``. Texts and commands are in
hexadecimal. The process answers ``stopped NUMBER``. Heartbeats are sent from the event loop, only while something
moves; the mount is asked nothing.
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

from gateway.system.own_commands import script_words

#: Seconds between two heartbeats.
BEAT = 0.25
#: A process that ended sooner than that after its start is not started again.
LASTED = 1.0
PROGRAM = Path(__file__).with_name("process.py")
#: What ends or suspends the gateway must not do so to its watchdog, from its first moment on.
HELD_BACK = [
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP")
    if hasattr(signal, name)  # Windows has two of them, and no watchdog
]
#: The descriptor of the socket in the process.
THERE = 3


def available() -> bool:
    """Whether this system can hand a line to another process."""
    return hasattr(os, "posix_spawn") and hasattr(socket, "send_fds")


class Watchdog:
    """The watchdog process of this gateway. ``warn`` is told when it cannot be kept running."""

    def __init__(self, warn: Callable[[str], None] = lambda text: None) -> None:
        self.warn = warn
        self._mounts: list[WatchedMount] = []
        self._beating: asyncio.TimerHandle | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._began = -LASTED
        self._connection: socket.socket | None = None
        self.pid: int | None = None
        self.start()

    def start(self) -> None:
        """Start the process; it needs no event loop. Where that fails there is none."""
        here, there = socket.socketpair()
        here.setblocking(False)
        arguments = [*script_words(str(PROGRAM)), str(THERE), str(os.getpid())]
        files = [(os.POSIX_SPAWN_OPEN, number, os.devnull, os.O_RDWR, 0) for number in (0, 1)]
        try:
            self.pid = os.posix_spawn(
                sys.executable,
                arguments,
                os.environ,
                file_actions=[*files, (os.POSIX_SPAWN_DUP2, there.fileno(), THERE)],
                setsigmask=HELD_BACK,
            )
            self._connection = here
        except OSError as error:
            here.close()
            self.warn(
                f"the watchdog process cannot be started ({error}): a gateway that is killed leaves its mount "
                "moving until mount-gateway stop is run"
            )
        finally:
            there.close()

    def mount(
        self,
        title: str,
        lock: Path | None,
        stop_commands: Callable[[], Sequence[bytes]],
        busy: Callable[[], bool],
        stopped: Callable[[], None],
    ) -> WatchedMount:
        """Another mount to be watched, from the event loop on which all of them run; see ``WatchedMount``."""
        if self._loop is None:
            self._loop = asyncio.get_running_loop()
            self._began = self._loop.time()
            self._listen()
        self._mounts.append(WatchedMount(self, len(self._mounts), title, lock, stop_commands, busy, stopped))
        return self._mounts[-1]

    def send(self, text: str, descriptors: Sequence[int] = ()) -> None:
        """Tell the process; never waits. One that takes nothing is as good as none."""
        if self._connection is not None:
            with contextlib.suppress(OSError):
                socket.send_fds(self._connection, [f"{text}\n".encode()], list(descriptors))

    def beat(self) -> None:
        """Be heard of, from now on and for as long as anything moves."""
        if self._beating is None and self._loop is not None:
            self._beating = self._loop.call_later(BEAT, self._on_beat)

    def _on_beat(self) -> None:
        self._beating = None
        moving = [mount for mount in self._mounts if mount.moving]
        for mount in moving:
            mount.renew()
        if any(mount.moving for mount in moving):
            self.send("beat")
            self.beat()

    def _listen(self) -> None:
        if self._loop is not None and self._connection is not None:
            self._loop.add_reader(self._connection.fileno(), self._heard)

    def _heard(self) -> None:
        """Something has come from the process, or it has ended."""
        assert self._connection is not None and self._loop is not None
        try:
            data = self._connection.recv(4096)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._ended()
            return
        for line in data.decode("ascii").splitlines():
            self._mounts[int(line.rpartition(" ")[2])].was_stopped()

    def _ended(self) -> None:
        """Somebody has killed the process: start another, unless it does not live."""
        assert self._loop is not None
        self._hang_up()
        if self._loop.time() - self._began < LASTED:
            self.warn(
                "the watchdog process does not keep running: a gateway that is killed leaves its mount moving "
                "until mount-gateway stop is run"
            )
            return
        self._began = self._loop.time()
        self.start()
        self._listen()
        for mount in self._mounts:
            mount.introduce()

    def _hang_up(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            if self._loop is not None:
                self._loop.remove_reader(connection.fileno())
            connection.close()
        if self.pid is not None:
            with contextlib.suppress(OSError):
                os.waitpid(self.pid, os.WNOHANG)

    def close(self) -> None:
        """The gateway ends in order: nothing moves any more, or what still does is for the process to stop."""
        if self._beating is not None:
            self._beating.cancel()
        for mount in self._mounts:
            mount.renew()
        self._hang_up()


class WatchedMount:
    """What the watchdog knows of one mount.

    ``stop_commands`` gives the bytes of its stop as things are now, ``busy`` whether it moves or is about to,
    ``stopped`` is called when the process has stopped it because this gateway was not heard of. ``lock`` is the file
    whose content changes when another gateway takes the mount.
    """

    def __init__(
        self,
        watchdog: Watchdog,
        number: int,
        title: str,
        lock: Path | None,
        stop_commands: Callable[[], Sequence[bytes]],
        busy: Callable[[], bool],
        stopped: Callable[[], None],
    ) -> None:
        self._watchdog, self._number, self._title, self._lock = watchdog, number, title, lock
        self._stop_commands, self._busy, self._stopped = stop_commands, busy, stopped
        self._descriptor: int | None = None
        self._told: Sequence[bytes] = ()
        self.moving = False

    def opened(self, descriptor: int) -> None:
        """The line to the mount is open at this descriptor."""
        self._descriptor = descriptor
        self.introduce()

    def closed(self) -> None:
        """The line is about to be closed."""
        self._descriptor = None
        self._watchdog.send(f"gone {self._number}")

    def introduce(self) -> None:
        """Hand the line over, and what stops the mount if it moves."""
        if self._descriptor is not None:
            words = (self._title, str(self._lock or ""))
            self._watchdog.send(
                f"line {self._number} {' '.join(word.encode().hex() or '00' for word in words)}", [self._descriptor]
            )
            self._told = ()
            if self.moving:
                self.renew()

    def begin(self) -> None:
        """The mount is about to be set moving."""
        self.moving = True
        self._tell()
        self._watchdog.beat()

    def renew(self) -> None:
        """See whether it still moves, and whether its stop is another one by now: its tracking has been suspended."""
        if self.moving:
            self.moving = self._busy()
            self._tell()

    def _tell(self) -> None:
        commands = tuple(self._stop_commands()) if self.moving else ()
        if commands != self._told:
            self._told = commands
            words = "".join(f" {command.hex()}" for command in commands)
            self._watchdog.send(f"{'moving' if commands else 'rest'} {self._number}{words}")

    def was_stopped(self) -> None:
        """The process has stopped the mount because this gateway was not heard of."""
        self._told = ()
        self._stopped()
