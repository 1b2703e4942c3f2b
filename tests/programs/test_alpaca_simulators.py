"""An LX200 program at a telescope of another maker's Alpaca server, `alpaca-simulators` of PyPI.

Its requests and replies are judged: whether it understands every request of the gateway, and whether the gateway
understands its replies. Its telescope is a point without mechanics, so positions are only compared roughly. Both run in
a network of their own, and the program reaches the gateway through a virtual serial port.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
import time
from pathlib import Path

import pytest
import serial

from .processes import Workshop, free_port, requires, wait_until
from .product import PRODUCT

SERVER = shutil.which("alpaca-simulators", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
TOGETHER = """
ip link set lo up
"$1" --host 127.0.0.1 --port "$2" --config template.yaml >"$3" 2>&1 &
until (exec 3<>"/dev/tcp/127.0.0.1/$2") 2>"$3.not-yet"; do sleep 0.1; done
shift 3
exec "$@"
"""
#: The requests that carry out what this program orders.
ORDERS = {"abortslew", "connected", "moveaxis", "park", "pulseguide", "slewtocoordinatesasync", "synctocoordinates",
          "tracking", "unpark"}  # fmt: skip
PARKED = "1032"


class Lx200:
    """A program that speaks LX200; every reply comes in bounded time."""

    def __init__(self, path: Path) -> None:
        self._port = serial.Serial(str(path), timeout=20.0)
        self.close = self._port.close

    def tell(self, said: str) -> None:
        self._port.write(said.encode())

    def ask(self, said: str, end: str = "#") -> str:
        self._port.reset_input_buffer()
        self.tell(said)
        return self._port.read_until(end.encode()).decode("latin-1").rstrip("#")

    def goes(self, first: str, second: str, order: str) -> str:
        """Send a target and an order to go there; return an empty text, or why it is refused."""
        assert self.ask(first, "1") == self.ask(second, "1") == "1"
        self._port.reset_input_buffer()
        self.tell(order)
        return "" if self._port.read(1) == b"0" else self._port.read_until(b"#").decode("latin-1")

    def goto(self, hours: float, dec: int) -> str:
        seconds = round(hours % 24.0 * 3600.0)
        at = f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
        return self.goes(f":Sr{at}#", f":Sd{dec:+03d}*00:00#", ":MS#")

    def number(self, question: str) -> float:
        """Hours or degrees."""
        found = re.match(r"([+-]?)(\d+)[:*\xdf](\d+)(?:[:'](\d+))?$", told := self.ask(question))
        assert found, told
        size = int(found[2]) + int(found[3]) / 60.0 + int(found[4] or 0) / 3600.0
        return -size if found[1] == "-" else size

    def place(self) -> tuple[float, float]:
        """Right ascension, hours, and declination."""
        return self.number(":GR#"), self.number(":GD#")

    def tracks(self) -> bool:
        self._port.reset_input_buffer()
        self.tell(":GW#")
        return self._port.read(3)[1:2] == b"T"

    def arrives(self) -> None:
        wait_until("the goto has ended", lambda: self.ask(":D#") == "")

    def arrow(self, letter: str) -> tuple[float, float]:
        """Press an arrow for a while; return how far it has moved the telescope, degrees east and north."""
        before = self.place()
        self.tell(f":RM#:M{letter}#")
        time.sleep(1.5)
        self.tell(f":Q{letter}#")
        time.sleep(1.5)
        after = self.place()
        return ((after[0] - before[0] + 12.0) % 24.0 - 12.0) * 15.0, after[1] - before[1]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["", ":altaz"], ids=["as it says", "alt-az"])
def test_lx200_program_drives_a_telescope_of_alpaca_simulators(workshop: Workshop, kind: str) -> None:
    requires("unshare", "ip", "bash", SERVER or "alpaca-simulators")
    port, surface, heard = str(free_port()), workshop.folder / "surface", workshop.folder / "server.log"
    gateway = workshop.start(
        [
            "unshare", "-rn", "bash", "-c", TOGETHER, "bash", SERVER or "", port, str(heard),
            *PRODUCT, "run", "--mount", f"alpaca{kind}@http://127.0.0.1:{port}", "--surface", f"lx200@pty:{surface}",
            # Its park position has a right ascension: at some hours the way from there would be too low.
            "--sun", "0", "--lowest", "-90", "--no-console", "--no-discovery", "--log",
        ],
        ends_well=True,
    )  # fmt: skip
    gateway.wait_for_lines("ready ", 1)
    one = Lx200(surface)
    workshop.keep(one.close)
    east = one.number(":GS#") + 1.0  # high enough for a while

    assert not one.tracks() and "parked: unpark it first" in one.goto(east, 40)
    one.tell(":Q#")
    one.tell(":hW#")
    wait_until("it tracks", one.tracks)

    assert one.goto(east, 40) == ""
    one.arrives()
    assert one.place() == pytest.approx((east % 24.0, 40.0), abs=0.02)

    assert one.goto(east - 5.0, 10) == ""
    time.sleep(1.0)
    assert one.goto(east - 4.0, 10) == "", "a newer goto"
    time.sleep(1.5)
    one.tell(":Q#")
    time.sleep(1.5)
    stood = one.place()
    time.sleep(1.5)
    assert one.place() == pytest.approx(stood, abs=0.01) and one.tracks()
    assert stood[1] > 10.5, "it was stopped on its way"

    one.arrow("e")
    assert one.arrow("n")[1] > 0.3 or kind
    assert one.arrow("e")[0] > 0.3 or kind, "MoveAxis counts the other way there, which the first arrow has shown"
    one.tell(":Mgn0400#")
    time.sleep(2.0)
    assert one.goto(east, 40) == ""
    one.arrives()
    assert one.goto(east, 41) == "" and one.ask(":D#")
    one.tell(":Q#")
    time.sleep(2.0)
    seconds = round((east + 0.02) % 24.0 * 3600.0)
    one.ask(f":Sr{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}#", "1")
    one.ask(":Sd+40*30:00#", "1")
    assert one.ask(":CM#")
    wait_until("it is synced", lambda: one.place() == pytest.approx(((east + 0.02) % 24.0, 40.5), abs=0.01))

    assert one.goes(":Sz150*00#", ":Sa+50*00#", ":MA#") == ""
    one.arrives()
    wait_until("it tracks again", one.tracks)
    assert (one.number(":GZ#"), one.number(":GA#")) == pytest.approx((150.0, 50.0), abs=0.1)

    one.tell(":hP#")
    wait_until("it is parked", lambda: not one.tracks())
    assert "parked: unpark it first" in one.goto(east, 40)

    said = heard.read_text()
    asked = re.findall(r'"(GET|PUT) \S*/(\w+)(?:\?\S*)? HTTP/1.1" (\d+)', said)
    assert {one for one in asked if one[2] != "200"} == {("GET", "description", "404")}, "it has no management"
    put = {member for method, member, _ in asked if method == "PUT"}
    assert put == (ORDERS | {"slewtoaltazasync"} if kind else ORDERS)
    assert set(re.findall(r'"ErrorNumber":(\d+)', gateway.output())) == {PARKED}
