"""Sky-Watcher's SynScan against its paper, typed by hand: as a simulated hand control and as a surface."""

from __future__ import annotations

import re

from gateway.protocols.wireformat.command_set import load
from tests.conformance.test_nexstar_surface_manual import manual_mount, talk_to
from tests.support.each import each
from tests.support.manual_files import raw, rows
from tests.unit.protocols.nexstar.simulator.test_simulator import Bench

FORMS = rows("synscan_forms.txt")
CLOCK = raw("H\\x0f\\x1a\\x00\\x04\\x06\\x05\\xfb\\x01")
#: A position anywhere, where the table has that of its state.
ANYWHERE = {"34AB,12CE#": "re:[0-9A-F]{4},[0-9A-F]{4}#", "34AB0500,12CE0500#": "re:[0-9A-F]{6}00,[0-9A-F]{6}00#"}


def fits(answer: bytes, reply: str) -> bool:
    if reply.startswith("re:"):
        return re.fullmatch(reply[3:].encode("latin-1"), answer, re.DOTALL) is not None
    return answer == (b"" if reply == "-" else raw(reply))


@each("name, request_, reply", FORMS)
def test_synscan_surface_replies_as_the_protocol_document_says(name: str, request_: str, reply: str) -> None:
    talk = talk_to("synscan", manual_mount(), "4.38.06")
    talk.send(CLOCK)
    assert fits(talk.send(raw(request_)), reply)
    assert talk.send(b"Kz") == b"z#"


@each("name, request_, reply", FORMS)
def test_simulated_synscan_replies_as_the_protocol_document_says(name: str, request_: str, reply: str) -> None:
    bench = Bench("synscan", "4.38.06")
    bench(CLOCK)
    assert fits(bench(raw(request_)), ANYWHERE.get(reply, reply))
    assert bench(b"Kz") == b"z#"


def test_synscan_model_has_exactly_the_documented_commands() -> None:
    has = {name for name, _, _ in FORMS if not name.startswith("no ")}
    assert has == set(load("nexstar").models["synscan"]["commands"])


def test_synscan_version_3_has_the_commands_documented_for_it() -> None:
    assert Bench("synscan", "3.38")(b"V") == b"032600#"
    assert Bench("synscan", "3.38")(b"s34AB0500,12CE0500p")[:1] == b"#"
    assert Bench("synscan", "3.36")(b"s34AB0500,12CE0500pKx") == b"x#"


def test_synscan_turns_tracking_on_after_a_goto() -> None:
    bench = Bench("synscan", "4.38.06")
    assert bench(b"T\0t") == b"#\0#"
    assert bench(b"r34AB0500,12CE0500t") == b"#\2#"


def test_old_synscan_keeps_moving_after_a_cancel_unless_both_axes_get_rate_0() -> None:
    for version, stops, goes in (("3.36", b"M", True), ("3.36", b"MP\2\x10\x24\0\0\0\0", True), ("3.38", b"M", False)):
        bench = Bench("synscan", version)
        bench(b"r34AB0500,12CE0500")
        bench.after(3.0)(stops)
        assert (bench.after(2.0)(b"L") == b"1#") is goes, (version, stops)
    bench = Bench("synscan", "3.36")
    bench(b"r34AB0500,12CE0500")
    bench.after(3.0)(b"MP\2\x10\x24\0\0\0\0P\2\x11\x24\0\0\0\0")
    assert bench.after(5.0)(b"L") == b"0#"


def test_synscan_german_mount_reads_0_and_90_at_its_index() -> None:
    assert Bench("synscan", "4.38.06")(b"Z") == b"0000,4000#"
    assert Bench("cge")(b"Z") == b"4000,4000#"
    mount = manual_mount()
    assert talk_to("synscan", mount, "4.38.06").send(b"Z") == b"D2AB,4000#"  # 12AB less a quarter of a turn
    assert talk_to("synscan", mount, "4.38.06").send(b"B0000,4000") == b"#"
    assert (mount.asked[-1].az, mount.asked[-1].alt) == (90.0, 90.0)  # type: ignore[attr-defined]
