"""Programs that speak HTTP are answered by the console's server, by the console's rules."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from gateway.app.config import Config, MountConfig, SurfaceConfig
from gateway.app.config.tables import ConsoleConfig
from gateway.app.gateway import Gateway
from gateway.cli.serve.console_and_broker import http_surfaces
from tests.unit.console.test_server import at_port

pytestmark = pytest.mark.real_time
PATIENCE = 60.0
API = "api/v1/telescope/"
#: Near the pole: it is up at any hour.
PLACE = {"RightAscension": "5.5", "Declination": "80.0"}


@contextlib.asynccontextmanager
async def opened(state: Path, mounts: int = 1, **page: Any) -> AsyncIterator[tuple[list[Gateway], Any]]:
    config = Config(mount=[], surface=[], console=ConsoleConfig(**page))
    gateways = []
    for number in range(mounts):
        mount = MountConfig(at="nexstar@sim", name=f"pier {number}", sun=0.0, speed=8.0, state=str(state / str(number)))
        surfaces = [SurfaceConfig(at="lx200@tcp://127.0.0.1:0"), *http_surfaces(config, mount)]
        gateways.append(Gateway(mount, surfaces, warn=lambda text: None))
    try:
        for gateway in gateways:
            await gateway.open()
        async with at_port(gateways, **page) as where, aiohttp.ClientSession() as http:

            async def ask(method: str, path: str, **more: Any) -> Any:
                async with http.request(method, where + path, **more) as response:
                    return await response.json() if response.content_type == "application/json" else response.status

            for number, gateway in enumerate(gateways):
                assert await gateway.wait_identified(PATIENCE)
                assert (await ask("PUT", f"{API}{number}/connected", data={"Connected": "true"}))["ErrorNumber"] == 0
            yield gateways, ask
    finally:
        for gateway in gateways:
            await gateway.close()


async def test_console_serves_every_mount_as_a_numbered_alpaca_device(tmp_path: Path) -> None:
    async with opened(tmp_path, mounts=2) as (gateways, ask):
        devices = (await ask("GET", "management/v1/configureddevices"))["Value"]
        assert [one["DeviceName"].split(":")[0] for one in devices] == ["pier 0", "pier 1"]
        assert len({one["UniqueID"] for one in devices}) == 2
        assert [one["DeviceNumber"] for one in devices] == [0, 1]
        assert (await ask("PUT", f"{API}1/slewtocoordinatesasync", data=PLACE))["ErrorNumber"] == 0
        assert (await ask("GET", f"{API}1/slewing"))["Value"] is True
        assert (await ask("GET", f"{API}0/slewing"))["Value"] is False
        assert gateways[1].state().programs == ("127.0.0.1",)
        assert len(gateways[0].names()) == 1, "it is no port of its own"
        assert await ask("GET", f"{API}2/slewing") == 400


@pytest.mark.parametrize("rules", [{"pin": "4711"}, {"read_only": True}, {"read_only": ["127.0.0.0/8"]}])
async def test_alpaca_programs_cannot_move_mounts_at_a_read_only_console(tmp_path: Path, rules: dict[str, Any]) -> None:
    async with opened(tmp_path, **rules) as (_, ask):
        assert (await ask("GET", f"{API}0/declination"))["ErrorNumber"] == 0
        assert (await ask("PUT", f"{API}0/slewtocoordinatesasync", data=PLACE))["ErrorNumber"] == 0x40B
        assert (await ask("PUT", f"{API}0/tracking", data={"Tracking": "false"}))["ErrorNumber"] == 0x40B
        assert (await ask("PUT", f"{API}0/abortslew"))["ErrorNumber"] == 0, "a stop is never refused"
        assert (await ask("GET", f"{API}0/slewing"))["Value"] is False
