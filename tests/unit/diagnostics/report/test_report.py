"""``report``: one file, whole and by itself, that says what the recording holds; mistakes are one line."""

from __future__ import annotations

import os
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from gateway.app.recording.format import read
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation
from gateway.cli import main
from gateway.diagnostics.report.gather import gather_night
from gateway.diagnostics.report.night import Night
from gateway.diagnostics.report.page import report_page, summary_sentences
from gateway.diagnostics.report.plots import altaz_track, light_intervals, reply_time_spreads, split_track
from tests.unit.diagnostics.report.recorded import BEGAN, REFUSED, SITE, TARGETS, Tape, head, night

HOSTILE = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return night(tmp_path_factory.mktemp("night") / "night.rec")


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its first minutes, where nothing but the file counts."""
    return night(tmp_path_factory.mktemp("night") / "short.rec", minutes=20)


@pytest.fixture(scope="module")
def seen(whole: Path) -> Night:
    return gather_night(read(whole))


def recorded(tmp_path: Path, tape: Tape, **more: object) -> Night:
    path = tmp_path / "some.rec"
    path.write_text(tape.text(**more))
    return gather_night(read(path))


class Reader(HTMLParser):
    """Every element is closed in order; what is fetched or run is kept."""

    VOID = frozenset({"meta", "link", "img", "br", "input"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.outside: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.outside += [f"{name}={value}" for name, value in attrs if name in ("src", "href") or name.startswith("on")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def judged(text: str) -> list[str]:
    """The elements of a page that is whole and needs nothing else."""
    reader = Reader()
    reader.feed(text)
    assert reader.open == [] and reader.outside == []
    assert not {"script", "img", "link", "iframe"} & set(reader.tags)
    assert "url(" not in text and "@import" not in text and "nan" not in re.sub(r">[^<]*<", "><", text)
    return reader.tags


# --- what is gathered -----------------------------------------------------------------------------------------------


def test_report_shows_positions_answers_programs_and_refusals(seen: Night) -> None:
    assert seen.site is not None and (seen.site.latitude, seen.site.longitude, seen.site.source) == (
        *SITE,
        "the settings",
    )
    assert seen.goto_count == len(TARGETS) and seen.unanswered_count == 0
    assert len(seen.request_times) == len(seen.reply_times) == 2520 - 30 + len(TARGETS)
    assert min(seen.reply_times) >= 0.055 and 0.05 < sorted(seen.reply_times)[len(seen.reply_times) // 2] < 0.08
    first, second = seen.programs.values()
    assert (first.host, first.commands["GR"], first.commands["MS"], first.refusal_count) == ("10.0.0.2", 2520, 5, 3)
    assert (second.surface, second.commands["e"], second.refusal_count) == ("nexstar@tcp://0.0.0.0:4031", 2520, 1)
    assert [remark.text for remark in seen.refusals].count(REFUSED) == 3
    assert len(seen.remarks) == 1 and "no answer to e within 3.5 s" in seen.remarks[0].text


def test_report_shows_the_mount_pointing_where_it_was_sent(seen: Night) -> None:
    sky = Sky()
    for minute, ra, dec in TARGETS[1:]:
        time = BEGAN + minute * 60.0 + 3000.0
        place = min(seen.pointings, key=lambda one: abs(one.time - time))
        assert separation(place.ra, place.dec, *sky.from_j2000(ra, dec, time)) < 0.01


def test_report_shows_tracking_slews_and_gaps_over_the_horizon(seen: Night) -> None:
    sky = Sky()
    places = altaz_track(seen, sky)
    last = places[-1]
    right = sky.az_alt(*sky.from_j2000(*TARGETS[-1][1:], last.time), *SITE, last.time)
    assert separation(last.az, last.alt, *right) < 0.05
    found = list(split_track(places))
    assert any(piece[-1].slewing for piece in found) and sum(len(piece) for piece in found) >= len(places)
    gaps = [place for place in places[1:] if not place.continues_track]
    assert [round((place.time - BEGAN) / 60) for place in gaps] == [155]  # the cable was back


def test_report_counts_a_lost_answer_without_shifting_other_times(tmp_path: Path) -> None:
    tape = Tape()
    tape.put(0.0, "mount", ">", b"e")
    tape.asked(5.0, b"e", b"00000000,00000000#", 0.25)
    tape.put(6.0, "mount", ">", b"J")
    tape.asked(7.0, b"J", b"\x01#", 0.5)
    found = recorded(tmp_path, tape)
    assert list(found.reply_times) == pytest.approx([0.25, 0.5])
    assert found.unanswered_count == 2


def test_report_counts_no_lost_answer_for_an_intervening_stop(tmp_path: Path) -> None:
    tape = Tape()
    tape.put(1.0, "mount", ">", b"e")
    tape.put(1.1, "mount", ">", b"M")
    tape.put(1.2, "mount", "<", b"00000000,00000000#")
    tape.put(1.4, "mount", "<", b"#")
    found = recorded(tmp_path, tape)
    assert list(found.reply_times) == pytest.approx([0.2, 0.3]) and found.unanswered_count == 0


def test_report_joins_position_and_site_that_a_meade_sends_in_pieces(tmp_path: Path) -> None:
    tape = Tape()
    tape.asked(0.0, b":Gt#", b"+48*08#", 0.1)
    tape.asked(1.0, b":Gg#", b"348*25#", 0.1)
    tape.asked(2.0, b":GR#", b"05:34:32#", 0.1)
    tape.asked(3.0, b":GD#", b"+22*00:52#", 0.1)
    tape.put(4.0, "mount", ">", b":Q#")
    tape.asked(5.0, b":GR#", b"05:34:32#", 0.1)
    found = recorded(tmp_path, tape, at="lx200:lx200gps@/dev/ttyUSB0", site=None)
    assert found.site is not None and found.site.source == "the mount"
    assert (found.site.latitude, found.site.longitude) == pytest.approx((48.1333, 11.5833), abs=1e-3)
    assert [(one.ra, one.dec) for one in found.pointings] == [pytest.approx((83.6333, 22.0144), abs=1e-3)]
    assert found.unanswered_count == 0  # :Q# has none


def test_report_shows_the_distribution_of_reply_times(seen: Night) -> None:
    found = reply_time_spreads(seen)
    assert all(one.quantile_05 <= one.median <= one.quantile_95 <= one.maximum for one in found)
    assert 200 <= len(found) <= 241
    assert max(one.maximum for one in found) == max(seen.reply_times)


def test_report_shows_day_and_night_behind_the_altitude_curve(seen: Night) -> None:
    day = Night("nexstar@-", [], BEGAN - 6 * 3600.0, BEGAN + 3600.0, site=seen.site)
    parts = light_intervals(day, Sky())
    assert [part.kind for part in parts] == ["day", "twilight", "dark"]
    assert parts[0].ended == pytest.approx(BEGAN - 2 * 3600.0, abs=600.0)  # the Sun sets at 15:28 UTC
    assert (parts[0].began, parts[-1].ended) == (day.began, day.ended)


# --- what is written ------------------------------------------------------------------------------------------------


def test_report_page_has_its_charts_its_tables_and_a_text_summary(seen: Night) -> None:
    text = report_page(seen, "night.rec")
    tags = judged(text)
    assert tags.count("svg") == 3 and tags.count("table") == 3
    said = " ".join(summary_sentences(seen, altaz_track(seen, Sky())))
    for words in (
        "From 17:30 to 00:29 UTC, 6 h 59 min",
        "It was sent to 5 places",
        "The mount answered all 2,495 questions.",
        "2 programs sent 7,565 commands.",
        "4 things were refused, 3 of them because",
        "The gateway noted 1 thing about the mount and its connection; it is listed below.",
    ):
        assert words in said
    assert "The night of 20 November 2026" in text and "3 ×" in text
    assert "prefers-color-scheme: dark" in text
    assert len(text) < 150_000


def test_report_shows_markup_sent_by_programs_as_text(tmp_path: Path) -> None:
    tape = Tape()
    tape.put(0.0, HOSTILE, "+", f"surface 1, host {HOSTILE}")
    tape.put(1.0, HOSTILE, ">", f":{HOSTILE}#".encode())
    tape.put(2.0, HOSTILE, "!", HOSTILE)
    tape.put(3.0, "mount", "!", HOSTILE)
    found = recorded(tmp_path, tape)
    text = report_page(found, HOSTILE)
    judged(text)
    assert text.count("&lt;script&gt;") >= 4


@pytest.mark.parametrize("lines", ["0.000000 mount ^\n", "0.1 10.0.0.1:1 + surface 1, host 10.0.0.1\n"])
def test_report_of_an_almost_empty_night_is_complete(lines: str, tmp_path: Path) -> None:
    path = tmp_path / "short.rec"
    path.write_text(head() + lines)
    found = gather_night(read(path))
    judged(report_page(found, path.name))
    said = summary_sentences(found, [])
    assert "The mount never reported its position." in said and "The mount answered no question." in said


def test_report_without_a_site_describes_places_in_words(tmp_path: Path) -> None:
    tape = Tape()
    tape.asked(1.0, b"e", b"40000000,10000000#", 0.1)
    found = recorded(tmp_path, tape, site=None)
    tags = judged(report_page(found, "some.rec"))
    assert tags.count("svg") == 1
    assert any("site is not known" in words for words in summary_sentences(found, altaz_track(found, Sky())))


# --- the command ----------------------------------------------------------------------------------------------------


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    code = main(["report", *map(str, arguments)])
    said = capsys.readouterr()
    return code, said.out, said.err


def test_report_is_written_beside_the_recording_or_to_the_given_path(
    short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = tmp_path / "night.rec"
    own.write_bytes(short.read_bytes())
    assert run(capsys, own) == (0, f"wrote {tmp_path / 'night.html'}\n", "")
    assert run(capsys, own)[0] == 0  # an older report gives way
    code, _, _ = run(capsys, own, "-o", tmp_path / "there.html")
    assert code == 0 and (tmp_path / "there.html").read_text() == (tmp_path / "night.html").read_text()


def test_report_of_a_truncated_recording_says_so(
    short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "cut.rec"
    path.write_bytes(short.read_bytes()[:-7])
    code, said, _ = run(capsys, path)
    assert code == 0 and "cut off in the middle of a line" in said
    assert "The recording is not whole" in (tmp_path / "cut.html").read_text()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "there is no such file"),
        ("hello\n", "is not a recording of mount-gateway"),
        ("# mount-gateway recording 1\n", "the settings of the recording cannot be read"),
        ("# mount-gateway recording 99\n{}\n", "has format 99, and this version of mount-gateway reads format 1"),
        (head(), "nothing happened in this recording"),
        (head() + "what is this\n", "is not a line of a recording"),
    ],
)
def test_report_explains_mistakes_in_one_line(
    content: str | None, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bad.rec"
    if content is not None:
        path.write_text(content)
    code, said, errors = run(capsys, path)
    assert (code, said) == (2, "") and words in errors and len(errors.splitlines()) == 1
    assert not (tmp_path / "bad.html").exists()


def test_report_overwrites_no_foreign_file(short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    there = tmp_path / "mine.html"
    there.write_text("mine")
    code, _, errors = run(capsys, short, "-o", there)
    assert code == 2 and "--force replaces it" in errors and there.read_text() == "mine"
    assert run(capsys, short, "-o", there, "--force")[0] == 0
    code, _, errors = run(capsys, short, "-o", short, "--force")
    assert code == 2 and "the recording itself" in errors and "mount-gateway recording" in short.read_text()[:30]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="only where there are pipes among files")
@pytest.mark.parametrize(("more", "words"), [([], "--force replaces it"), (["--force"], "a plain file is needed")])
def test_report_does_not_replace_a_pipe(
    more: list[str], words: str, short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    os.mkfifo(pipe := tmp_path / "pipe")
    code, said, errors = run(capsys, short, "-o", pipe, *more)
    assert (code, said) == (2, "") and words in errors and pipe.is_fifo()
