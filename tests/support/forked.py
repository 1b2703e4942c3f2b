"""Product processes that are forked from one that has loaded the package already, instead of loading it again.

Loading takes most of the processor time of a start. `Forked` is the test's side and looks like a ``subprocess.Popen``;
run as a program, this file is the server that loads and forks. Its children have the streams, the environment, the
folder and the command line of a normally started process; they let no process calculate an almanac. A test of the start
itself uses ``tests.support.process.GATEWAY``.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import json
import os
import pkgutil
import runpy
import selectors
import signal
import socket
import subprocess
import sys
import threading
import time
import traceback
import warnings
from pathlib import Path
from typing import Any, TextIO

#: Whether the system supports this.
POSSIBLE = sys.platform == "linux"
#: Modules that are not preloaded: one takes longer than all the rest, the others are programs of their own.
LEFT_OUT = ("gateway.astro.ephemeris.by_astropy", "gateway.app.watchdog.process", "gateway.__main__")
#: The longest command line that a child can show, and the longest request, in bytes.
ROOM, REQUEST = 8000, 100_000
PRODUCT = Path(__file__).with_name("mount-gateway")
PATIENCE = 120.0


class Forked:
    """A product process with these arguments, or a script, in this process's environment and ``environment``.

    Stdout and stderr are text pipes; with ``sink``, a file descriptor, they go there, and the process leads a session.
    SIGUSR1 blocks it for ``hangs`` seconds.
    """

    stdout: TextIO
    stderr: TextIO
    _server: tuple[subprocess.Popen[bytes], socket.socket] | None = None

    def __init__(self, *arguments: str, hangs: float = 0.0, sink: int | None = None, **environment: str) -> None:
        control = self._control()
        told, warned = [self._pipe(name) if sink is None else os.dup(sink) for name in ("stdout", "stderr")]
        self._life, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        request = {
            "words": arguments, "environment": {**os.environ, **environment}, "folder": os.getcwd(), "hangs": hangs,
            "leads": sink is not None,
        }  # fmt: skip
        socket.send_fds(control, [json.dumps(request).encode()], [told, warned, there.fileno()])
        for number in (told, warned):
            os.close(number)
        there.close()
        self.returncode: int | None = None
        self.pid = self._word(PATIENCE)

    def _pipe(self, name: str) -> int:
        """Set the attribute to the reading end of a new pipe; return the other end."""
        reading, writing = os.pipe()
        setattr(self, name, os.fdopen(reading, encoding="utf-8"))
        return writing

    @classmethod
    def _control(cls) -> socket.socket:
        """Return the socket to the fork server, which the first call starts."""
        if cls._server is None:
            here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            words = [sys.executable, "-bb", "-P", __file__, str(there.fileno()), " " * ROOM]
            cls._server = subprocess.Popen(words, pass_fds=[there.fileno()]), here
            there.close()
        return cls._server[1]

    @classmethod
    def end(cls) -> None:
        """End the fork server; it kills the children that are still running."""
        if cls._server is not None:
            process, control = cls._server
            control.close()
            process.wait(PATIENCE)
            cls._server = None

    def _word(self, patience: float | None) -> int:
        """Receive the next number: first the pid, later the exit code. Raises TimeoutError."""
        self._life.settimeout(patience)
        try:
            said = self._life.recv(100)
        except BlockingIOError:
            raise TimeoutError from None
        if not said:
            raise RuntimeError("the process that forks has ended")
        return int(said)

    def wait(self, patience: float | None = None) -> int:
        """Return the exit code, or the negative signal number. Raises TimeoutExpired."""
        if self.returncode is None:
            try:
                self.returncode = self._word(patience)
            except TimeoutError:
                raise subprocess.TimeoutExpired("mount-gateway", patience or 0.0) from None
            self._life.close()
        return self.returncode

    def poll(self) -> int | None:
        """Return the exit code; None while the process runs."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self.wait(0.0)
        return None

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


# --- the server program: loads the package and forks on request ---------------------------------------------------


def load() -> None:
    """Import everything that a product process may need."""
    import gateway
    from gateway.astro.ephemeris import keeper
    from gateway.protocols.registry import protocol_pairs
    from gateway.protocols.wireformat.command_set import load as tables

    keeper.DAYS_PER_CALCULATION = 0
    for module in pkgutil.walk_packages(gateway.__path__, "gateway."):
        if module.name not in LEFT_OUT:
            importlib.import_module(module.name)
    for name in {name for pair in protocol_pairs() for name in pair}:
        one = tables(name)
        _ = one.surface_rows, one.own_rows, one.driver_rows, one.models
    gc.collect()
    gc.freeze()


def serve(control: socket.socket) -> None:
    """Fork on every request until the test process closes its end; returns in every child."""
    living: dict[int, tuple[int, socket.socket]] = {}
    with selectors.DefaultSelector() as selector:
        selector.register(control, selectors.EVENT_READ)
        while True:
            for key, _ in selector.select():
                if key.fileobj is control:
                    request, descriptors, _, _ = socket.recv_fds(control, REQUEST, 3)
                    if not request:
                        for pid, _ in living.values():
                            os.kill(pid, signal.SIGKILL)
                        sys.exit(0)
                    out, err, life = descriptors
                    pid = os.fork()
                    if not pid:
                        for number in (life, *living):
                            os.close(number)
                        break
                    os.close(out)
                    os.close(err)
                    watched = os.pidfd_open(pid)
                    living[watched] = pid, socket.socket(fileno=life)
                    selector.register(watched, selectors.EVENT_READ)
                    living[watched][1].send(str(pid).encode())
                else:
                    selector.unregister(key.fd)
                    os.close(key.fd)
                    pid, told = living.pop(key.fd)
                    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
                    with contextlib.suppress(OSError):  # the test process has closed its end
                        told.send(str(code).encode())
                    told.close()
            else:
                continue
            break
    for _, told in living.values():
        told.close()
    control.close()
    become(json.loads(request), out, err)


def become(request: dict[str, Any], out: int, err: int) -> None:
    """Make a forked child look like a process that was started normally."""
    for number, place in ((out, 1), (err, 2)):
        os.dup2(number, place)
        os.close(number)
    sys.stdout = os.fdopen(1, "w", closefd=False)  # the old objects may have cached the type of the old file
    sys.stderr = os.fdopen(2, "w", buffering=1, errors="backslashreplace", closefd=False)
    os.environ.clear()
    os.environ.update(request["environment"])
    os.chdir(request["folder"])
    if request["leads"]:
        os.setsid()
    signal.signal(signal.SIGQUIT, signal.SIG_DFL)  # a shell ignores it for background jobs
    if request["hangs"]:
        signal.signal(signal.SIGUSR1, lambda number, frame: time.sleep(request["hangs"]))
    sys.argv = [str(PRODUCT), *request["words"]]
    shown = "\0".join([sys.executable, "-bb", "-P", *sys.argv]).encode() + b"\0"
    first, end = (int(number) for number in Path("/proc/self/stat").read_text().rpartition(")")[2].split()[45:47])
    with contextlib.suppress(OSError), open("/proc/self/mem", "r+b", buffering=0) as memory:  # else ps shows the parent
        memory.seek(first)
        memory.write(shown.ljust(end - first, b"\0"))


def live() -> int:
    """Run the command or the script, then skip the interpreter's teardown, which costs as much as loading."""
    from gateway.cli import main

    code = 1
    try:
        if sys.argv[1:2] and sys.argv[1].endswith(".py"):
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", BytesWarning)  # a script may print what it has received
            del sys.argv[0]
            runpy.run_path(sys.argv[0], run_name="__main__")
            code = 0
        else:
            code = main()
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except BaseException:
        traceback.print_exc()
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    return code


if __name__ == "__main__":
    load()
    serve(socket.socket(fileno=int(sys.argv[1])))
    os._exit(live())
