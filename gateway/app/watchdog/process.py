"""The watchdog process: it stops the mounts that its gateway has set moving if the gateway dies or hangs.

It runs as a script, without ``site``, and imports nothing of the gateway, so it starts within milliseconds and stays
under 10 MiB. It holds duplicates of the descriptors of the gateway's lines, and reads the messages that ``client.py``
describes. While a mount moves, ``MAX_SILENCE`` seconds without a message (``MAX_STARVED_SILENCE`` on a busy computer if
all moving mounts are in checked gotos), or the end of the socket, mean that the gateway no longer supervises it. It is
then sent stops for some seconds, unless another gateway has taken it. The process ends after its gateway has ended.
"""

from __future__ import annotations

import _socket  # the module ``socket`` would cost more than a megabyte
import os
import select
import sys
import time

#: Seconds without a heartbeat after which a gateway with a moving mount counts as hung.
MAX_SILENCE = 1.2
#: The longer limit if every moving mount has a clear path and the gateway gets no processor time; the fraction of
#: the silence for which the gateway must have waited for a processor; seconds between two checks of this wait.
MAX_STARVED_SILENCE, MIN_WAIT_FRACTION, WAITING_CHECK_PERIOD = 5.0, 0.8, 0.25
#: Seconds between two commands of a stop: a hand control must answer each before it can receive the next.
COMMAND_GAP = 0.15
#: Seconds within which a server must accept a connection; how many used connections stay open.
CONNECT_TIMEOUT, MAX_KEPT_CONNECTIONS = 0.4, 6
#: A stop is sent so many times, once in so many seconds: the first may end up in the middle of a command.
STOP_COUNT, STOP_PERIOD = 5, 1.0
#: If this process itself did not run for so many seconds, it cannot judge whether the gateway was silent.
FREEZE_TIME = 0.5


class GuardedMount:
    """One mount: a duplicate of its descriptor, who holds its lock, and the commands that stop it while it moves."""

    def __init__(self, title: str, lock_path: str, descriptor: int) -> None:
        self.title, self.lock_path, self.descriptor = title, lock_path, descriptor
        self.holder = read_lock_file(lock_path)
        self.stop_commands: list[bytes] = []
        #: Whether its only motion is a goto on a path that was checked against the limits.
        self.path_is_clear = False

    def is_taken_over(self) -> bool:
        """Whether another gateway has taken this mount."""
        return read_lock_file(self.lock_path) != self.holder

    def send(self, command: bytes) -> None:
        """Write a command, unless the line is lost or its buffer is full."""
        try:
            if select.select([], [self.descriptor], [], COMMAND_GAP)[1]:
                os.write(self.descriptor, command)
        except OSError:
            pass  # the stop is repeated a second later

    def prepare_stop(self) -> None:
        """Do nothing: the line is open already. ``ServedMount`` connects to its server here."""

    def close(self) -> None:
        """Close the duplicate of the descriptor; the gateway's own is not affected."""
        os.close(self.descriptor)

    def unlock(self) -> None:
        """Let the next gateway open the port: the duplicate shares the lock of the dead gateway's descriptor."""
        import fcntl

        try:
            fcntl.flock(self.descriptor, fcntl.LOCK_UN)
        except (OSError, ValueError):
            pass  # a socket has no lock, and a server no descriptor


class ServedMount(GuardedMount):
    """A mount behind a server. Each stop command is a whole HTTP request on a new connection, because servers may close
    a connection after an answer. ``connect_mode`` is ``beside`` if a connection may be opened in advance.
    """

    def __init__(self, title: str, lock_path: str, host: str, port: str, connect_mode: str) -> None:
        super().__init__(title, lock_path, -1)
        self.address, self.preconnected = (host, int(port)), connect_mode == "beside"
        self.next_connections: list[_socket.socket] = []
        #: The connections that were used last: closing a connection could cancel its request.
        self.used_connections: list[_socket.socket] = []

    def prepare_stop(self, connect_now: bool = False) -> None:
        """Connect, unless an unused connection is still open; without ``connect_now`` only in ``beside`` mode."""
        if self.next_connections and select.select(self.next_connections, [], [], 0.0)[0]:
            self.next_connections.pop().close()
        if (connect_now or self.preconnected) and self.stop_commands and not self.next_connections:
            family = _socket.AF_INET6 if ":" in self.address[0] else _socket.AF_INET
            made = _socket.socket(family, _socket.SOCK_STREAM)
            try:
                made.settimeout(CONNECT_TIMEOUT)
                made.connect(self.address)
                self.next_connections.append(made)
            except OSError:
                made.close()  # it is tried again with the next command

    def send(self, command: bytes) -> None:
        self.prepare_stop(connect_now=True)
        try:
            self.next_connections[0].send(command)
        except (IndexError, OSError):
            pass
        self.used_connections += self.next_connections
        self.next_connections.clear()
        while len(self.used_connections) > MAX_KEPT_CONNECTIONS:
            self.used_connections.pop(0).close()

    def close(self) -> None:
        for connection in (*self.next_connections, *self.used_connections):
            connection.close()


def read_lock_file(path: str) -> bytes:
    """Return the first 100 bytes of a file; empty if it cannot be read. A lock file names its holder there."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
    except (OSError, ValueError):
        return b""
    try:
        return os.read(descriptor, 100)
    except OSError:
        return b""  # a file of a process that has ended since it was opened
    finally:
        os.close(descriptor)


def cpu_wait(pid: str) -> float:
    """Return the seconds for which a process has waited for a processor since its start; NaN if unknown (not Linux)."""
    columns = read_lock_file(f"/proc/{pid}/schedstat").split()
    return int(columns[1]) / 1e9 if len(columns) == 3 else float("nan")


class GatewayWatch:
    """Watches a gateway by its messages; stops its moving mounts if it dies or hangs."""

    def __init__(self, connection: _socket.socket, gateway_pid: str) -> None:
        self.connection, self.gw_pid = connection, gateway_pid
        self.mounts: dict[str, GuardedMount] = {}
        self.last_heard = 0.0
        #: Seconds that the gateway had waited for a processor at its last message; seconds of silence now tolerated.
        self._cpu_wait, self._timeout = 0.0, MAX_SILENCE
        self._partial_line = b""

    def run(self) -> None:
        """Watch until the gateway has ended, and stops were sent to the mounts that were moving then."""
        while True:
            moving = [mount for mount in self.mounts.values() if mount.stop_commands]
            began = time.monotonic()
            left = max(0.0, self.last_heard + self._timeout - began) if moving else None
            if select.select([self.connection], [], [], left)[0]:
                if not self.receive():
                    self.stop_for_ended_gateway(moving)
                    return
            elif left is not None and self._timeout == MAX_SILENCE and time.monotonic() - began > left + FREEZE_TIME:
                self.reset_silence()  # the whole computer was suspended or overloaded
            elif all(mount.path_is_clear for mount in moving) and self.is_starved():
                self._timeout = min(MAX_STARVED_SILENCE, time.monotonic() - self.last_heard + WAITING_CHECK_PERIOD)
            else:
                self.stop_for_silent_gateway(moving)

    def reset_silence(self) -> None:
        """Measure the gateway's silence from now on: it has sent something, or this process did not run."""
        self.last_heard, self._cpu_wait, self._timeout = time.monotonic(), cpu_wait(self.gw_pid), MAX_SILENCE

    def is_starved(self) -> bool:
        """Whether the gateway may be silent for longer, because it has been waiting for a processor."""
        silence = time.monotonic() - self.last_heard
        return silence < MAX_STARVED_SILENCE and cpu_wait(self.gw_pid) - self._cpu_wait >= MIN_WAIT_FRACTION * silence

    def receive(self) -> bool:
        """Read and handle the gateway's messages; return False if the gateway has closed the socket."""
        try:
            data, ancillary, _, _ = self.connection.recvmsg(65536, _socket.CMSG_SPACE(64))
        except OSError:
            return False
        descriptors = [
            int.from_bytes(content[at : at + 4], sys.byteorder)
            for _, kind, content in ancillary
            if kind == _socket.SCM_RIGHTS
            for at in range(0, len(content), 4)
        ]
        self.reset_silence()
        *lines, self._partial_line = (self._partial_line + data).split(b"\n")
        for line in lines:
            self.handle(line.decode("ascii").split(" "), descriptors)
        return bool(data)

    def handle(self, parts: list[str], descriptors: list[int]) -> None:
        """Act on a message of the gateway, split into words."""
        kind, number = [*parts, ""][:2]
        if kind == "line":
            self.drop(number)
            title, lock = (bytes.fromhex(word).decode() for word in parts[2:4])
            self.mounts[number] = GuardedMount(title, lock, descriptors.pop(0))
        elif kind == "server":
            self.drop(number)
            self.mounts[number] = ServedMount(*(bytes.fromhex(word).decode() for word in parts[2:7]))
        elif kind == "gone":
            self.drop(number)
        elif number in self.mounts and kind in ("moving", "clear", "rest"):
            self.mounts[number].stop_commands, self.mounts[number].path_is_clear = (
                [bytes.fromhex(word) for word in parts[2:]],
                kind == "clear",
            )
            self.mounts[number].prepare_stop()

    def drop(self, number: str) -> None:
        """Forget a mount, if it is known; close the duplicate of its descriptor, or its connections."""
        mount = self.mounts.pop(number, None)
        if mount is not None:
            mount.close()

    def stop_for_ended_gateway(self, mounts: list[GuardedMount]) -> None:
        """Unlock a dead gateway's mounts; send stops to each for some seconds or until another gateway takes it."""
        self.write_to_stderr(mounts, "has ended")
        for mount in mounts:
            mount.unlock()
        times = 0
        while mounts and times < STOP_COUNT:
            began = time.monotonic()
            send_stops(mounts)
            time.sleep(max(0.0, began + STOP_PERIOD - time.monotonic()))
            mounts = [mount for mount in mounts if not mount.is_taken_over()]
            times += 1

    def stop_for_silent_gateway(self, mounts: list[GuardedMount]) -> None:
        """Send stops to the mounts of a gateway that hangs, for some seconds or until it sends something again."""
        busy = ", because the computer is too busy to run it," if self._timeout > MAX_SILENCE else ""
        self.write_to_stderr(mounts, f"has not responded for {round(time.monotonic() - self.last_heard, 1):g} s{busy}")
        for attempt in range(STOP_COUNT):
            began = time.monotonic()
            send_stops(mounts)
            if attempt == 0:
                self.report_stops(mounts)
            if select.select([self.connection], [], [], max(0.0, began + STOP_PERIOD - time.monotonic()))[0]:
                self.reset_silence()
                return
        for mount in mounts:
            mount.stop_commands = []

    def write_to_stderr(self, mounts: list[GuardedMount], reason: str) -> None:
        """Write one line for each mount to the gateway's stderr, if it is still open."""
        for mount in mounts:
            text = (
                f"mount-gateway watchdog: the gateway (process {self.gw_pid}) {reason} while {mount.title} moved; "
                "stopping the mount.\n"
            )
            try:
                os.write(2, text.encode())
            except OSError:
                pass

    def report_stops(self, mounts: list[GuardedMount]) -> None:
        """Report to the gateway, in case it resumes, that stops were sent to these mounts."""
        numbers = [number for number, mount in self.mounts.items() if mount in mounts]
        try:
            self.connection.send("".join(f"stopped {number}\n" for number in numbers).encode())
        except OSError:
            pass  # the gateway has died meanwhile


def send_stops(mounts: list[GuardedMount]) -> None:
    """Send the stops of these mounts in parallel, command by command, but none to a mount that another gateway has."""
    for place in range(max((len(mount.stop_commands) for mount in mounts), default=0)):
        for mount in mounts:
            if place < len(mount.stop_commands) and not mount.is_taken_over():
                mount.send(mount.stop_commands[place])
        time.sleep(COMMAND_GAP)


def main() -> None:
    """Run ``process.py DESCRIPTOR PID``: watch the gateway PID at the other end of the socket DESCRIPTOR."""
    try:
        os.setsid()
    except OSError:
        pass  # it leads a session already
    descriptor, gateway = int(sys.argv[1]), sys.argv[2]
    GatewayWatch(_socket.socket(_socket.AF_UNIX, _socket.SOCK_STREAM, 0, descriptor), gateway).run()


if __name__ == "__main__":
    main()
