"""Product processes that are forked from one that has loaded the product already, instead of loading it again.

Loading takes most of the processor time of a start. `Forked` is the test's side and looks like a ``subprocess.Popen``;
run as a program this file is the side that loads and forks. Its children have the streams, the environment, the folder
and the command line of a process that was started as usual; astropy they do not load. A test of the start itself takes
``tests.support.process.GATEWAY``.
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

#: Whether the system has what this needs.
POSSIBLE = sys.platform == "linux"
#: Not loaded beforehand: what takes longer than all the rest, and what is a program of its own.
LEFT_OUT = ("gateway.astro.ephemeris.by_astropy", "gateway.app.watchdog.process", "gateway.__main__")
#: How long a command line can be that a child shows, and of how many bytes a request.
ROOM, REQUEST = 8000, 100_000
PRODUCT = Path(__file__).with_name("mount-gateway")
PATIENCE = 20.0


class Forked:
    """A process of the product with these arguments, or of a script; stdout and stderr are pipes of text.

    Where it ``hangs`` SIGUSR1 blocks it for so many seconds.
    """

    _server: tuple[subprocess.Popen[bytes], socket.socket] | None = None

    def __init__(self, *arguments: str, hangs: float = 0.0) -> None:
        control = self._control()
        (out, told), (err, warned) = os.pipe(), os.pipe()
        self._life, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        request = {"words": arguments, "environment": dict(os.environ), "folder": os.getcwd(), "hangs": hangs}
        socket.send_fds(control, [json.dumps(request).encode()], [told, warned, there.fileno()])
        for number in (told, warned):
            os.close(number)
        there.close()
        self.stdout: TextIO = os.fdopen(out, encoding="utf-8")
        self.stderr: TextIO = os.fdopen(err, encoding="utf-8")
        self.returncode: int | None = None
        self.pid = self._word(PATIENCE)

    @classmethod
    def _control(cls) -> socket.socket:
        """The way to the process that forks: from the first time on there is one."""
        if cls._server is None:
            here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            words = [sys.executable, "-bb", "-P", __file__, str(there.fileno()), " " * ROOM]
            cls._server = subprocess.Popen(words, pass_fds=[there.fileno()]), here
            there.close()
        return cls._server[1]

    @classmethod
    def end(cls) -> None:
        """No more are wanted; those that still live are killed."""
        if cls._server is not None:
            process, control = cls._server
            control.close()
            process.wait(PATIENCE)
            cls._server = None

    def _word(self, patience: float | None) -> int:
        """What is told next: its number, and later its exit code. Raises TimeoutError."""
        self._life.settimeout(patience)
        try:
            said = self._life.recv(100)
        except BlockingIOError:
            raise TimeoutError from None
        if not said:
            raise RuntimeError("the process that forks has ended")
        return int(said)

    def wait(self, patience: float | None = None) -> int:
        """Its exit code, the number of the signal below zero. Raises TimeoutExpired."""
        if self.returncode is None:
            try:
                self.returncode = self._word(patience)
            except TimeoutError:
                raise subprocess.TimeoutExpired("mount-gateway", patience or 0.0) from None
            self._life.close()
        return self.returncode

    def poll(self) -> int | None:
        """Its exit code; None while it lives."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self.wait(0.0)
        return None

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


# --- the program: load, and fork as often as it is asked for ------------------------------------------------------


def load() -> None:
    """Everything that a process of the product may need."""
    import gateway
    from gateway.astro.ephemeris.sky import TableLoader
    from gateway.protocols.registry import pairs
    from gateway.protocols.wireformat.command_set import load as tables

    TableLoader.start = lambda *_: None  # type: ignore[method-assign]
    for module in pkgutil.walk_packages(gateway.__path__, "gateway."):
        if module.name not in LEFT_OUT:
            importlib.import_module(module.name)
    for name in {name for pair in pairs() for name in pair}:
        one = tables(name)
        _ = one.surface, one.own, one.driver, one.models
    gc.collect()
    gc.freeze()


def serve(control: socket.socket) -> None:
    """Fork until nobody is there to ask for it; returns in every child."""
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
                    with contextlib.suppress(OSError):  # nobody wants to know
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
    """A child takes what is its own."""
    for number, place in ((out, 1), (err, 2)):
        os.dup2(number, place)
        os.close(number)
    sys.stdout = os.fdopen(1, "w", closefd=False)  # those from before may remember what kind of file it was
    sys.stderr = os.fdopen(2, "w", buffering=1, errors="backslashreplace", closefd=False)
    os.environ.clear()
    os.environ.update(request["environment"])
    os.chdir(request["folder"])
    signal.signal(signal.SIGQUIT, signal.SIG_DFL)  # a shell in the background has it ignored
    if request["hangs"]:
        signal.signal(signal.SIGUSR1, lambda number, frame: time.sleep(request["hangs"]))
    sys.argv = [str(PRODUCT), *request["words"]]
    shown = "\0".join([sys.executable, "-bb", "-P", *sys.argv]).encode() + b"\0"
    first, end = (int(number) for number in Path("/proc/self/stat").read_text().rpartition(")")[2].split()[45:47])
    with contextlib.suppress(OSError), open("/proc/self/mem", "r+b", buffering=0) as memory:  # else ps shows the other
        memory.seek(first)
        memory.write(shown.ljust(end - first, b"\0"))


def live() -> int:
    """Run the command, or a script, to its end, but leave what was loaded as it is: taking that apart costs as much."""
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
