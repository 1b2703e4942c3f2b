"""A hand control's ``#`` means that it was done: where it was not, the no-response form, silence, or a word in the log.

The no-response form (NexStar protocol, Pass-through Commands with No Response) is as many bytes as were asked for, one
more, ``#``: for a command that asks for none ``00 23``.
"""

from __future__ import annotations

import asyncio

import pytest

from gateway.core.operations import Direction, Move, Rate
from gateway.diagnostics.virtual_time import run
from tests.integration.settings.test_settings_kept import notes
from tests.support.cable import Cable
from tests.support.in_process_gateway import Bridge

MEADES = ["lx200", "lx200-16", "autostar", "lx200gps"]
NO = b"\0#"
GUIDE_RATE = b"P\x02\x10\x46\x40\0\0\0"
BACKLASH = b"P\x02\x11\x10\x1e\0\0\0"
PLAYBACK = b"P\x02\x10\x0d\x01\0\0\0"
#: What each Meade lacks by its manual.
LACKS = {
    "lx200": {GUIDE_RATE, BACKLASH},
    "lx200-16": {GUIDE_RATE, BACKLASH},
    "autostar": {GUIDE_RATE, BACKLASH, PLAYBACK},
    "lx200gps": set(),
}


def over(mount: str, surface: str = "cge", **settings: object) -> Bridge:
    return Bridge(
        mount, driven="lx200", presented="nexstar", surface=surface, config={"lowest": -90.0, "sun": 0.0}, **settings
    )  # type: ignore[arg-type]


@pytest.mark.parametrize("mount", MEADES)
@pytest.mark.parametrize("setting", [GUIDE_RATE, BACKLASH, PLAYBACK])
async def test_nexstar_command_that_a_meade_lacks_gets_the_no_response_form(mount: str, setting: bytes) -> None:
    async with over(mount) as bridge:
        client = bridge.client()
        before = len(bridge.sent_requests())
        answer = await client.ask(setting)
        if setting in LACKS[mount]:
            assert answer == NO
            assert not [
                one for one in bridge.sent_requests()[before:] if one.startswith((b":Rg", b":$B", b":$Q", b"$Q"))
            ]
            if setting != PLAYBACK:
                reading = {GUIDE_RATE: b"P\x01\x10\x47\0\0\0\x01", BACKLASH: b"P\x01\x11\x40\0\0\0\x01"}[setting]
                assert (await client.ask(reading))[:1] != setting[4:5], "it is not told as if it were in force"
        else:
            assert answer == b"#"


@pytest.mark.parametrize("mount", MEADES)
async def test_gps_is_reported_linked_only_where_a_receiver_exists(mount: str) -> None:
    async with over(mount, "cpc") as bridge:
        client = bridge.client()
        linked = b"\x01#" if mount == "lx200gps" else b"\0#"
        assert await client.ask(b"P\x01\xb0\x37\0\0\0\x01", 30.0) == linked
        assert await client.ask(b"P\x01\xb0\x36\0\0\0\x01", 30.0) == linked


@pytest.mark.parametrize("mount", [*MEADES, "6-8se"])
async def test_only_a_stop_is_acknowledged_while_the_line_is_down(mount: str) -> None:
    """What was not done is not done later either; but a site, a goto and a sync are told no by silence."""
    driven = "nexstar" if mount == "6-8se" else "lx200"
    async with Bridge(
        mount,
        driven=driven,
        presented="nexstar",
        surface="cpc" if driven == "lx200" else "6-8se",
        config={"lowest": -90.0, "sun": 0.0},
    ) as bridge:
        client, cable = bridge.client(), Cable(bridge)
        cable.pull()
        await asyncio.sleep(5.0)
        for order in (
            b"P\x02\x10\x24\x09\0\0\0",
            b"P\x02\x11\x25\x05\0\0\0",
            b"P\x03\x10\x06\x02\x58\0\0",
            b"P\x03\x11\x26\x32\x64\0\0",
        ):
            assert await client.ask(order, 1.0) == NO
        for order in (
            b"r35555555,20000000",
            b"B12AB,4000",
            b"s35555555,20000000",
            b"T\x02",
            b"W\x21\x33\x1e\x01\x97\x0c\x24\x00",
            b"H\x14\x1e\x28\x03\x0e\x1b\x0a\x00",
        ):
            assert await client.ask(order, 4.0) == b"", order
        for stop in (b"M", b"P\x02\x10\x24\0\0\0\0", b"P\x02\x11\x25\0\0\0\0"):
            assert await client.ask(stop, 1.0) == b"#"
        assert await client.ask(b"Kx") == b"x#"
        assert "Arrow: No answer from mount." in notes(bridge)
        before = len(bridge.sent_requests())
        cable.plug()
        await asyncio.sleep(30.0)
        assert not [
            one
            for one in bridge.sent_requests()[before:]
            if one.startswith((b":M", b":CM", b":S", b"r", b"R", b"b", b"B", b"W", b"H"))
        ]
        assert (await client.ask(b"w"))[:1] == b"\x2d"


@pytest.mark.parametrize("mount", ["lx200", "lx200-16"])
async def test_log_says_that_a_classic_cannot_sleep(mount: str) -> None:
    async with over(mount) as bridge:
        client = bridge.client()
        assert await client.ask(b"x") == b"#"
        await asyncio.sleep(2.0)
        assert await client.ask(b"t") in (b"\x01#", b"\x02#"), "it tracks"
        assert "Hibernate: The mount keeps tracking" in notes(bridge)


# --- home switches and the focuser ----------------------------------------------------------------------------------


@pytest.mark.parametrize("mount", MEADES)
def test_nexstar_home_search_starts_the_search_of_a_meade_with_sensors(mount: str) -> None:
    """AUX 0x0B and 0x12 of both motors are one ``:hF#``."""

    async def program() -> None:
        async with over(mount, "cpc") as bridge:
            client = bridge.client()
            seek = [b"P\x01\x10\x0b\0\0\0\0", b"P\x01\x11\x0b\0\0\0\0"]
            found = b"P\x01\x10\x12\0\0\0\x01"
            if mount in ("lx200", "autostar"):
                assert [await client.ask(one) for one in seek] == [NO, NO]
                assert await client.ask(found) == (b"\0\0#" if mount == "lx200" else b"\0#")
                assert b":hF#" not in bridge.sent_requests()
                return
            for axis in (b"\x10", b"\x11"):
                assert await client.ask(b"P\x02" + axis + b"\x24\x09\0\0\0") == b"#"
            await asyncio.sleep(3.0)
            for axis in (b"\x10", b"\x11"):
                assert await client.ask(b"P\x02" + axis + b"\x24\0\0\0\0") == b"#"
            await asyncio.sleep(3.0)
            assert [await client.ask(one) for one in seek] == [b"#", b"#"]
            assert bridge.sent_requests().count(b":hF#") == 1
            assert await client.ask(found) == b"\0#"
            await asyncio.sleep(120.0)
            assert await client.ask(found) == b"\xff#"

    run(program())


@pytest.mark.parametrize("mount", MEADES)
async def test_nexstar_focuser_commands_move_and_stop_the_focuser_of_a_meade(mount: str) -> None:
    """Its positions count outwards: 0x24 is ``:F-#``, out of the tube; 0x25 ``:F+#``."""
    async with over(mount) as bridge:
        client = bridge.client()
        for way, command in ((b"\x24", b":F-#"), (b"\x25", b":F+#")):
            before = len(bridge.sent_requests())
            assert await client.ask(b"P\x02\x12" + way + b"\x09\0\0\0") == b"#"
            await asyncio.sleep(1.0)
            assert command in bridge.sent_requests()[before:]
            assert bridge.sim.accessories["focuser"] == (1 if way == b"\x25" else -1)
            assert await client.ask(b"P\x02\x12\x24\0\0\0\0") == b"#"
            await asyncio.sleep(1.0)
            assert bridge.sim.accessories["focuser"] == 0
        assert await client.ask(b"P\x02\x12\x24\x0a\0\0\0") == NO
        assert await client.ask(b"P\x02\xb4\x24\x05\0\0\0") == NO


# --- clocks ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mount", MEADES)
async def test_year_that_a_meade_would_misread_is_not_set(mount: str) -> None:
    """Two digits: 99 is 1999 to a Meade. ``H`` has no form for no, the clock of a CGE has one."""
    async with over(mount) as bridge:
        client = bridge.client()
        assert await client.ask(b"H\x14\x1e\x28\x03\x0e\x63\x0a\x00") == b"#"
        assert (await client.ask(b"h"))[5:6] == b"\x1a", "it goes on telling the mount's own 2026"
        assert await client.ask(b"P\x03\xb2\x84\x08\x33\0\0") == NO  # 2099
        assert await client.ask(b"P\x03\xb2\x84\x08\x02\0\0") == b"#"  # 2050
        await asyncio.sleep(20.0)
        assert not [one for one in bridge.sent_requests() if one.startswith(b":SC") and one.endswith(b"/99#")]
        assert "2050" in notes(bridge)


@pytest.mark.parametrize("mount", MEADES)
async def test_clock_of_a_version_without_a_set_command_is_not_set(mount: str) -> None:
    """NexStar protocol, RTC Commands: Set applies to 3.01+."""
    async with over(mount, surface_version="2.3") as bridge:
        client = bridge.client()
        for setting in (
            b"P\x03\xb2\x83\x03\x0e\x00\x00",
            b"P\x03\xb2\x84\x07\xeb\x00\x00",
            b"P\x04\xb2\xb3\x14\x1e\x28\x00",
        ):
            assert await client.ask(setting) == NO
        await asyncio.sleep(5.0)
        assert not [one for one in bridge.sent_requests() if one.startswith((b":SC", b":SL", b":SG"))]


@pytest.mark.parametrize("mount", MEADES)
@pytest.mark.parametrize("lowest", [-90.0, 10.0])
async def test_setting_site_or_clock_at_rest_sends_no_stop(mount: str, lowest: float) -> None:
    """Half way round the world the place that it shows is below the limit: it stands there, and nobody moves it."""
    async with Bridge(
        mount, driven="lx200", presented="nexstar", surface="cge", config={"lowest": lowest, "sun": 0.0}
    ) as bridge:
        client = bridge.client()
        for order in (b"W\x21\x33\x1e\x01\x97\x0c\x24\x00", b"H\x0a\x1e\x28\x08\x0e\x1b\x0a\x00"):
            assert await client.ask(order) == b"#"
            for _ in range(20):
                await client.ask(b"e")
                await asyncio.sleep(1.0)
        assert not [one for one in bridge.sent_requests() if one.startswith(b":Q")]


async def test_motion_is_accepted_again_when_the_line_is_back() -> None:
    """The form for no is of the moment."""
    async with over("lx200gps") as bridge:
        client, cable = bridge.client(), Cable(bridge)
        cable.pull()
        await asyncio.sleep(2.0)
        assert await client.ask(b"P\x02\x11\x24\x05\0\0\0") == NO
        cable.plug()
        await asyncio.sleep(20.0)
        assert await client.ask(b"P\x02\x11\x24\x05\0\0\0") == b"#"
        await asyncio.sleep(1.0)
        assert bridge.controller.wanted.axes_moved_by_hand == {2}
        await bridge.controller.perform(Move(Direction.NORTH, Rate(name="guide")))


MOTIONS = (
    b"P\x02\x10\x24\x05\0\0\0",
    b"P\x03\x11\x06\x0e\x10\0\0",
    b"P\x03\x10\x26\x32\x1e\0\0",
    b"P\x04\x10\x06\0\x3c\0\0",
)
STOPS = (b"M", b"P\x02\x10\x24\0\0\0\0", b"P\x03\x11\x06\0\0\0\0")


@pytest.mark.parametrize("mount", ["lx200gps", "cge"])
@pytest.mark.parametrize("why", ["held", "asleep"])
async def test_motion_gets_the_no_response_form_during_a_hold_or_sleep(mount: str, why: str) -> None:
    driven = "nexstar" if mount == "cge" else "lx200"
    async with Bridge(
        mount,
        driven=driven,
        presented="nexstar",
        surface="cge",
        surface_version="4.22",
        config={"lowest": -90.0, "sun": 0.0},
    ) as bridge:
        client = bridge.client()
        if why == "held":
            bridge.controller.hold.is_on = True
        else:
            client.send(b"x")
            await asyncio.sleep(3.0)
        before = len(bridge.sent_requests())
        for motion in MOTIONS:
            assert await client.ask(motion) == NO, motion
        for stop in STOPS:
            assert await client.ask(stop) == b"#", stop
        assert await client.ask(b"r40000000,10000000") == b"#", "there is no form for no"
        assert [entry for entry in bridge.entries if entry.note.startswith("Goto: ")]
        await asyncio.sleep(2.0)
        assert not [one for one in bridge.sent_requests()[before:] if one.startswith((b"r", b":MS", b":M", b":RG#"))]


@pytest.mark.parametrize("mount", ["lx200gps", "cge"])
async def test_nexstar_command_is_refused_as_soon_as_the_mounts_answer_is_overdue(mount: str) -> None:
    """Not only once the line counts as down, which takes up to ten seconds."""
    driven = "nexstar" if mount == "cge" else "lx200"
    async with Bridge(
        mount, driven=driven, presented="nexstar", surface="cge", config={"lowest": -90.0, "sun": 0.0}
    ) as bridge:
        client = bridge.client()
        await client.ask(b"e")
        bridge.controller.line.wire.feed = lambda data: b""  # type: ignore[attr-defined]
        polling = bridge.client("10.0.0.9")
        for _ in range(15):
            polling.send(b"e")
            await asyncio.sleep(0.2)
        assert bridge.controller.line.state == "up"
        assert await client.ask(b"r40000000,10000000", 3.5) == b""
        assert await client.ask(MOTIONS[0], 3.5) == NO
        assert await client.ask(b"M", 3.5) == b"#"


@pytest.mark.parametrize(
    "data",
    [
        b"P\x03\x10\x26\x65\x1e\0\0",
        b"P\x03\x11\x26\x9b\x1e\0\0",
        b"P\x02\x10\x0d\x02\0\0\0",
        b"P\x02\x11\x24\x0a\0\0\0",
        b"P\x02\x10\x10\x64\0\0\0",
    ],
)
async def test_nexstar_command_with_data_out_of_range_is_refused(data: bytes) -> None:
    """101 % of the guide rate either way, PEC 2, key 10, backlash 100."""
    async with over("lx200gps") as bridge:
        client, before = bridge.client(), len(bridge.sent_requests())
        assert await client.ask(data) == NO
        assert not [one for one in bridge.sent_requests()[before:] if one.startswith((b":M", b":$", b":R"))]


# --- guiding ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("mount", "version", "answer"), [("cpc", "4.21", NO), ("evolution", "5.31", b"#")])
async def test_alt_az_pulse_that_the_motors_cannot_do_is_refused(mount: str, version: str, answer: bytes) -> None:
    """A guider that is told yes waits for pulses that never come, and no pulse is under way then."""
    async with Bridge(mount, version, presented="nexstar", surface=None) as bridge:
        client = bridge.client()
        before = len(bridge.sent_requests())
        assert await client.ask(b"P\x03\x10\x26\x32\x32\0\0") == answer
        await asyncio.sleep(1.0)
        sent = [one for one in bridge.sent_requests()[before:] if one[:1] == b"P"]
        assert (b"P\x03\x10\x26\x32\x32\0\0" in sent) is (answer == b"#")
        if answer == NO:
            assert (await client.ask(b"P\x01\x10\x27\0\0\0\x01"))[:1] != b"\x01"
