"""Three programs on one mount, each on a surface of its own: Alpaca, LX200 and NexStar; and what each of them reads."""

from __future__ import annotations

import asyncio
import calendar
import datetime
import json
import re
from pathlib import Path
from typing import Any

from gateway.app.bindings import AcceptorFactory
from gateway.app.config import Endpoint, SurfaceConfig
from gateway.core.waiting import TimedEvent
from gateway.protocols.alpaca.http.programs import AlpacaClient
from gateway.transport.handler import NewConnection
from gateway.transport.web_server import WebServer
from tests.support.in_process_gateway import Bridge

PROTOCOLS = ("alpaca", "lx200", "nexstar")


class Wire:
    """A connection of one program on the network."""

    def __init__(self, acceptor: Any, host: str) -> None:
        self.heard, self._more = b"", TimedEvent()
        self.guest = acceptor.accept(NewConnection(f"{host}:50000", host, self._hear))

    def _hear(self, data: bytes) -> None:
        self.heard += data
        self._more.set()

    async def ask(self, data: bytes, length: int = 1, end: bytes = b"", seconds: float = 10.0) -> bytes:
        """Send bytes and return the reply: so many bytes at least, up to ``end``."""
        self.heard = b""
        self.guest.feed(data)
        until = asyncio.get_running_loop().time() + seconds
        while len(self.heard) < length or not self.heard.endswith(end):
            self._more.clear()
            if not await self._more.wait_within(until - asyncio.get_running_loop().time()):
                break
        return self.heard

    def close(self) -> None:
        self.guest.close()


class ThreePrograms(Bridge):
    """``readings`` are what the programs read: site, hours of UTC since the true time, hours of sidereal time."""

    def __init__(self, mount: str = "cge", *arguments: Any, state: Path | None = None, **others: Any) -> None:
        super().__init__(mount, *arguments, state=state, surface=None, **others)
        made = AcceptorFactory(
            self.controller, Endpoint(self._driven, "sim"), self.gateway.config, self.shared_state, self.clock,
            self.controller.astrometry.sky, self.warned.append, WebServer(),
        )  # fmt: skip
        self.faces: dict[str, Any] = {
            name: made.make(number, Endpoint(name, "tcp://127.0.0.1:0"), SurfaceConfig(at=f"{name}@tcp://127.0.0.1:0"))
            for number, name in enumerate(PROTOCOLS, 1)
        }

    def lx200(self, host: str = "10.0.0.2") -> Wire:
        return Wire(self.faces["lx200"], host)

    def nexstar(self, host: str = "10.0.0.3") -> Wire:
        return Wire(self.faces["nexstar"], host)

    async def alpaca(self, *lines: str, host: str = "10.0.0.1") -> Any:
        """Send requests of one Alpaca program; return the answer to the last one."""
        if not hasattr(self, "_lines"):
            self._lines = AlpacaClient(self.faces["alpaca"].accept, f"{host}:id-1", host)
            await self._lines.ask(b"put connected Connected=True\n")
        told = None
        for line in lines:
            told = json.loads(await self._lines.ask(line.encode() + b"\n"))
        return told

    async def sets(self, who: str, latitude: float, longitude: float, unix: float | None = None) -> None:
        """One program sets a site, and a clock if it is given (UTC)."""
        moment = None if unix is None else datetime.datetime.fromtimestamp(unix, datetime.UTC)
        if who == "alpaca":
            lines = [f"put sitelatitude SiteLatitude={latitude}", f"put sitelongitude SiteLongitude={longitude}"]
            if moment is not None:
                lines.append(f"put utcdate UTCDate={moment:%Y-%m-%dT%H:%M:%S}Z")
            await self.alpaca(*lines)
        elif who == "lx200":
            wire = self.lx200()
            west = (-longitude) % 360.0
            north, minutes = divmod(round(abs(latitude) * 60), 60)
            sign = "-" if latitude < 0 else "+"
            await wire.ask(f":St{sign}{north:02}*{minutes:02}#".encode())
            await wire.ask(f":Sg{int(west):03}*{round(west % 1 * 60):02}#".encode())
            if moment is not None:
                await wire.ask(f":SG+00#:SL{moment:%H:%M:%S}#:SC{moment:%m/%d/%y}#".encode(), 3, b"#")
            wire.close()
        else:
            wire = self.nexstar()
            parts = [
                (int(abs(value)), int(abs(value) * 60 % 60), round(abs(value) * 3600) % 60, int(value < 0))
                for value in (latitude, longitude)
            ]
            await wire.ask(b"W" + bytes((*parts[0], *parts[1])))
            if moment is not None:
                year = moment.year - 2000
                date = (moment.hour, moment.minute, moment.second, moment.month, moment.day, year, 0, 0)
                await wire.ask(b"H" + bytes(date))
            wire.close()
        await asyncio.sleep(3.0)

    async def reading(self, who: str) -> tuple[float, float, float, float]:
        """Return latitude, longitude, the error of UTC in hours, and sidereal time in hours, as a program is told."""
        if who == "alpaca":
            latitude, longitude = await self.alpaca("get sitelatitude"), await self.alpaca("get sitelongitude")
            utc = datetime.datetime.fromisoformat((await self.alpaca("get utcdate")).replace("Z", "+00:00")).timestamp()
            sidereal = await self.alpaca("get siderealtime")
        elif who == "lx200":
            wire = self.lx200()

            async def ask(question: bytes) -> str:
                return (await wire.ask(question, end=b"#")).rstrip(b"#").decode("latin-1")

            latitude, longitude = signed_degrees(await ask(b":Gt#")), -signed_degrees(await ask(b":Gg#"))
            stamp = f"{await ask(b':GC#')} {await ask(b':GL#')}"
            local = datetime.datetime.strptime(stamp, "%m/%d/%y %H:%M:%S")
            utc = calendar.timegm(local.timetuple()) + float(await ask(b":GG#")) * 3600.0
            sidereal = signed_degrees(await ask(b":GS#"))
            wire.close()
        else:
            wire = self.nexstar()
            place, clock = await wire.ask(b"w", 9), await wire.ask(b"h", 9)
            latitude, longitude = (
                (one[0] + one[1] / 60 + one[2] / 3600) * (-1 if one[3] else 1) for one in (place[:4], place[4:8])
            )
            zone = (clock[6] + 128) % 256 - 128 + clock[7]
            when = datetime.datetime(2000 + clock[5], clock[3], clock[4], *clock[:3])
            utc = calendar.timegm(when.timetuple()) - zone * 3600.0
            sidereal = None
            wire.close()
        longitude = (longitude + 180.0) % 360.0 - 180.0
        if sidereal is None:  # a NexStar has no command for it
            sidereal = self.controller.astrometry.sky.sidereal_time(utc, longitude) / 15.0
        ahead = (utc - self.clock()) / 3600.0
        return round(latitude, 1), round(longitude, 1), round(ahead, 1) + 0.0, round(sidereal, 2)


def signed_degrees(text: str) -> float:
    """Return degrees, minutes and seconds, however they are separated, as degrees."""
    parts = [float(part) for part in re.findall(r"\d+", text)]
    value = sum(part / 60**power for power, part in enumerate(parts))
    return -value if text.startswith("-") else value
