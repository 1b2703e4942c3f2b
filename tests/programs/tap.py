"""A tap on a TCP line to a simulated mount: everything passes, and what goes towards the mount is written down."""

from __future__ import annotations

import contextlib
import socket
import threading

from .processes import Workshop


class Tap:
    """Listens on `port`, connects to a mount; `heard` are the pieces that the mount was sent, in order."""

    def __init__(self, workshop: Workshop, mount: int) -> None:
        self.heard: list[bytes] = []
        self._mount = mount
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self._links: list[socket.socket] = [self._listener]
        workshop.keep(self.close)
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        for link in self._links:
            with contextlib.suppress(OSError):
                link.shutdown(socket.SHUT_RDWR)
            link.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                far = socket.create_connection(("127.0.0.1", self._mount))
                self._links += [near, far]
                threading.Thread(target=self._pass, args=(near, far, True), daemon=True).start()
                threading.Thread(target=self._pass, args=(far, near, False), daemon=True).start()

    def _pass(self, source: socket.socket, sink: socket.socket, towards: bool) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(4096):
                if towards:
                    self.heard.append(data)
                sink.sendall(data)
            sink.shutdown(socket.SHUT_WR)
