"""A private INDI server with one driver, and an INDI client of a few lines.

The client keeps every property vector of the driver's device as it was last sent, and the whole
sequence of what was sent, because a test often asks what happened *since* it did something.
INDI protocol 1.7: XML elements without a root, `def…Vector`, `set…Vector`, `new…Vector`.
"""

from __future__ import annotations

import select
import shutil
import socket
import tempfile
import time
import uuid
from collections.abc import Callable, Collection
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import pytest

from .processes import PATIENCE, Process, Workshop, accepts, free_port, requires, wait_until


class Vector(NamedTuple):
    """One property vector as the driver sent it: its kind (Number, Switch, Text, …), state and values."""

    kind: str
    name: str
    state: str
    values: dict[str, str]

    def number(self, element: str) -> float:
        return float(self.values[element])

    def on(self) -> set[str]:
        """The switches that are on."""
        return {element for element, value in self.values.items() if value == "On"}


class IndiServer:
    """`indiserver` with one driver, in a home folder where nothing was ever saved."""

    def __init__(self, workshop: Workshop, driver: str) -> None:
        requires("indiserver", driver)
        home = workshop.folder / f"home-{uuid.uuid4().hex}"
        home.mkdir()
        self.port = free_port()
        short = Path(tempfile.mkdtemp(prefix="indi-"))  # the path of a Unix socket has 107 bytes at most
        workshop.keep(lambda: shutil.rmtree(short, ignore_errors=True))
        argv = ["indiserver", "-p", str(self.port), "-u", str(short / "socket"), "-r", "0", driver]
        self.process: Process = workshop.start(argv, {"HOME": str(home)})
        wait_until(f"{self.process} listens", lambda: accepts(self.port))

    def end(self) -> None:
        """End the server; its driver ends with it."""
        self.process.end()


class IndiClient:
    """One device of one INDI server, as a program sees it."""

    def __init__(self, port: int, device: str) -> None:
        self.device = device
        self.vectors: dict[str, Vector] = {}
        self.history: list[Vector] = []
        self.messages: list[str] = []
        self._parser: ElementTree.XMLPullParser[ElementTree.Element] = ElementTree.XMLPullParser(["start", "end"])
        self._parser.feed("<indi>")
        self._depth = 0
        self._wire = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
        self.ask_for_everything()

    def ask_for_everything(self) -> None:
        """Have the driver define all its properties, with the values they have now.

        Some drivers change a value without telling; it shows only when they are asked.
        """
        self._wire.sendall(b'<getProperties version="1.7"/>\n')

    def close(self) -> None:
        self._wire.close()

    def pump(self, seconds: float = 0.05) -> None:
        """Take in what the server sends, waiting at most `seconds` for the first of it."""
        if not select.select([self._wire], [], [], seconds)[0]:
            return
        data = self._wire.recv(65536)
        assert data, f"indiserver closed the connection; {self._story()}"
        self._parser.feed(data)
        for happening in self._parser.read_events():
            element = happening[-1]
            self._depth += 1 if happening[0] == "start" else -1
            if happening[0] == "end" and self._depth == 1 and isinstance(element, ElementTree.Element):
                self._take(element)

    def _take(self, element: ElementTree.Element) -> None:
        if element.get("message"):
            self.messages.append(element.get("message", ""))
        if element.get("device") != self.device:
            return
        name = element.get("name", "")
        if element.tag == "delProperty":
            self.vectors.pop(name, None)
        elif element.tag.endswith("Vector"):
            known = self.vectors.get(name)
            values = dict(known.values) if known else {}
            values |= {one.get("name", ""): (one.text or "").strip() for one in element}
            kind = element.tag[3:].removesuffix("Vector")
            state = element.get("state") or (known.state if known else "Idle")
            self.vectors[name] = Vector(kind, name, state, values)
            self.history.append(self.vectors[name])

    def _story(self) -> str:
        said = "\n".join(self.messages[-12:])
        states = ", ".join(f"{vector.name}={vector.state}" for vector in self.vectors.values())
        return f"{self.device} has {states or 'no property'}; it said:\n{said}"

    def wait_for(self, what: str, happened: Callable[[], bool]) -> None:
        """Listen until `happened()`; in the end fail with what the driver told meanwhile."""
        deadline = time.monotonic() + PATIENCE
        while not happened():
            if time.monotonic() > deadline:
                pytest.fail(f"{what}: not within {PATIENCE:g} s; {self._story()}")
            self.pump()

    def listen(self, seconds: float) -> None:
        """Take in everything for that long."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self.pump()

    def wait_for_vector(self, name: str) -> Vector:
        """The vector of this name, once the driver has defined it."""
        self.wait_for(f"property {name}", lambda: name in self.vectors)
        return self.vectors[name]

    def wait_for_value(self, name: str, element: str) -> Vector:
        """The vector of this name, once the driver has told a value of this element."""
        self.wait_for(
            f"a value of {name}.{element}", lambda: self.wait_for_vector(name).values[element] not in {"", "-"}
        )
        return self.vectors[name]

    def since(self, mark: int, name: str) -> list[Vector]:
        """What was sent of one vector since the history had `mark` entries."""
        return [vector for vector in self.history[mark:] if vector.name == name]

    def send(self, name: str, values: dict[str, str]) -> None:
        """Write to elements of a vector (`new…Vector`)."""
        kind = self.wait_for_vector(name).kind
        members = "".join(f"<one{kind} name={quoteattr(e)}>{v}</one{kind}>" for e, v in values.items())
        head = f"<new{kind}Vector device={quoteattr(self.device)} name={quoteattr(name)}>"
        self._wire.sendall(f"{head}{members}</new{kind}Vector>\n".encode())

    def set(self, name: str, values: dict[str, str], states: Collection[str] = ("Ok",)) -> Vector:
        """Write, and wait until the driver answers with one of these states. What it answered."""
        mark = len(self.history)
        self.send(name, values)
        self.wait_for(
            f"{name} {'/'.join(states)} after {values}",
            lambda: any(vector.state in states for vector in self.since(mark, name)),
        )
        return next(vector for vector in self.since(mark, name) if vector.state in states)

    def switch(self, name: str, element: str, states: Collection[str] = ("Ok",)) -> Vector:
        """Turn one switch on."""
        return self.set(name, {element: "On"}, states)
