"""Hamlib's rotator daemon, and a terminal for it where there is only a TCP port.

`rotctld` rather than one-shot `rotctl`, which sends a stop when it closes and so ends its own slew.
Hamlib opens terminals only; `socat` makes one that leads to a TCP port.
"""

from __future__ import annotations

import socket

from .processes import PATIENCE, Workshop, free_port, requires, wait_until

MEADE = 1801
CELESTRON = 1401


def terminal_to(workshop: Workshop, port: int) -> str:
    """A pseudo terminal whose bytes go to and come from a TCP port of this machine."""
    requires("socat")
    link = workshop.folder / f"terminal-{port}"
    workshop.start(["socat", f"PTY,link={link},raw,echo=0", f"TCP:127.0.0.1:{port},nodelay"])
    wait_until(f"terminal {link}", link.exists)
    return str(link)


class Rotator:
    """`rotctld` on a terminal, asked through its TCP port as `rotctl` and satellite trackers do."""

    def __init__(self, workshop: Workshop, model: int, terminal: str) -> None:
        requires("rotctld")
        port = free_port()
        argv = ["rotctld", "-m", str(model), "-r", terminal, "-T", "127.0.0.1", "-t", str(port), "-vvvv"]
        daemon = workshop.start(argv)
        self._model = model
        self._wire = socket.socket()
        workshop.keep(self._wire.close)
        self._wire.settimeout(PATIENCE)
        # One connection only: when it ends, Hamlib 4.5 closes its descriptor twice, and that of a next one with it.
        wait_until(f"{daemon} listens", lambda: self._wire.connect_ex(("127.0.0.1", port)) == 0)
        self._reader = self._wire.makefile("r", encoding="ascii", newline="\n")
        workshop.keep(self._reader.close)

    def _ask(self, command: str, lines: int) -> list[str]:
        self._wire.sendall(f"{command}\n".encode("ascii"))
        answer = [self._reader.readline().strip()]
        while len(answer) < lines and not answer[0].startswith("RPRT"):
            answer.append(self._reader.readline().strip())
        return answer

    def position(self) -> tuple[float, float]:
        """`p`: azimuth and elevation in degrees.

        Hamlib 4.5 takes one second of arc in a Meade's reply (`060*30:01#`) for a minus sign; nothing is negative here.
        """
        answer = self._ask("p", 2)
        assert not answer[0].startswith("RPRT"), f"position refused: {answer}"
        azimuth, elevation = map(float, answer)
        return (abs(azimuth), abs(elevation)) if self._model == MEADE else (azimuth, elevation)

    def go(self, azimuth: float, elevation: float) -> None:
        """`P`: turn there; returns when the mount has accepted it."""
        assert self._ask(f"P {azimuth:g} {elevation:g}", 1) == ["RPRT 0"]

    def stop(self) -> None:
        """`S`: stop where it is."""
        assert self._ask("S", 1) == ["RPRT 0"]
