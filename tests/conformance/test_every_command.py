"""Every command of both manuals on every model that is presented, said to the whole gateway, one conversation a model.

What is expected was typed by hand (``conformance/manual``): the form of reply that the model's column demands, silence,
or what is done beyond the manual. Nothing is taken from the mapping tables.
"""

from __future__ import annotations

import asyncio
import re

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge
from tests.support.manual_files import fits, raw, rows

MEADE = ("autostar", "lx200", "lx200-16", "lx200gps")
#: Mounts behind the Meade face whose hand controls have the least, and a newer one.
HARD = [
    ("nexstar-gps", "1.2", "alt-az"),
    ("gt", "101.0", "alt-az"),
    ("nexstar-gps", "1.6", "alt-az"),
    ("cge", "3.01", "eq-north"),
]
#: How long a reply may take, and how long silence is listened to; virtual seconds.
PATIENCE, LISTEN = 12.0, 0.3
SITE = (45.0, 10.0)


async def _answer(client: object, said: bytes, silent: bool) -> bytes:
    await client.ask(said, LISTEN if silent else PATIENCE)  # type: ignore[attr-defined]
    await asyncio.sleep(0.05)
    heard: bytes = client.received  # type: ignore[attr-defined]
    return heard


def _lx200_talks(model: str) -> list[list[tuple[str, str]]]:
    """Every form that the model has, and what programs send beyond them; then what is said of this model."""
    forms = rows("lx200_forms.txt") + rows("lx200_beyond.txt")
    return [
        [(example, shapes) for _, example, models, shapes in forms if models == "-" or model in models.split(",")],
        [(said, shapes) for models, said, shapes, _ in rows("lx200_models.txt") if model in models.split(",")],
    ]


def test_every_lx200_form_has_an_expected_reply_for_every_model() -> None:
    """What a column of the manual denies is typed as well: 145 forms times four models, and none twice."""
    denied = rows("lx200_models.txt")[-34:]
    for model in MEADE:
        outside = {example for _, example, models, _ in rows("lx200_forms.txt") if model not in models.split(",")}
        typed = {example for models, example, _, _ in rows("lx200_models.txt") if model in models.split(",")}
        assert outside <= typed, (model, outside - typed)
        assert outside == {example for models, example, _, _ in denied if model in models.split(",")} | (
            outside & {":??#"}
        ), model


@pytest.mark.parametrize(("model", "mount"), [(model, None) for model in MEADE] + [("lx200gps", hard) for hard in HARD])
def test_every_meade_command_gets_its_expected_reply_from_the_gateway(
    model: str, mount: tuple[str, str, str] | None
) -> None:
    async def program() -> list[object]:
        name, version, mode = mount or ("6-8se", None, None)
        config = {"site": SITE, "mode": mode} if mode else None
        wrong: list[object] = []
        async with Bridge(name, version, surface=model, config=config) as bridge:
            for number, talk in enumerate(_lx200_talks(model), 1):
                client = bridge.client(f"127.0.0.{number}")
                for said, shapes in talk:
                    heard = await _answer(client, raw(said), "-" in shapes.split(" ~ "))
                    if not fits(heard, shapes):
                        wrong.append((said, heard, shapes))
            assert not [entry.note for entry in bridge.entries if "internal error" in entry.note]
        return wrong

    assert run(program()) == []


# --- Celestron --------------------------------------------------------------------------------------------------------


def _number(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split("."))


def _demanded(request: bytes, since: str, shape: str, model: list[str]) -> str | None:
    """The reply that this model and version must give; None is silence."""
    _, number, gps, rtc, version, counts_as = model
    if _number(since) > _number(counts_as):  # a device that nobody asks does not answer
        passed_through = request[:1] == b"P" and _number(counts_as) >= (1, 6)
        return f"\\x00{{{request[7] + 1}}}#" if passed_through else None
    major, minor = _number(version.removeprefix("starsense-"))[:2]
    for word, device in (("GPS ", gps), ("RTC ", rtc)):
        if shape.startswith(word):
            shape = shape.removeprefix(word) if device != "-" else f"\\x00{{{request[7] + 1}}}#"
    shape = shape.replace("TAIL", "\\x01\\x14" if version == "starsense-1.20" else "")
    return shape.replace("MODEL ", f"\\x{int(number):02x}").replace("MAJOR MINOR ", f"\\x{major:02x}\\x{minor:02x}")


@pytest.mark.sampled(every=3)
@pytest.mark.parametrize("model", rows("nexstar_models.txt"), ids=lambda model: f"{model[0]}/{model[4]}")
def test_every_celestron_command_gets_its_expected_reply_from_the_gateway(model: list[str]) -> None:
    async def program() -> list[object]:
        wrong: list[object] = []
        async with Bridge(
            "lx200gps", driven="lx200", presented="nexstar", surface=model[0], surface_version=model[4], latency=0.01
        ) as bridge:
            client = bridge.client()
            for name, said, since, shape in rows("nexstar_replies.txt"):
                shape_here = _demanded(raw(said), since, shape, model)
                heard = (await _answer(client, raw(said), shape_here is None)).decode("latin-1")
                if heard if shape_here is None else not re.fullmatch(shape_here, heard, re.DOTALL):
                    wrong.append((name, heard, shape_here))
            assert not [entry.note for entry in bridge.entries if "internal error" in entry.note]
        return wrong

    assert run(program()) == []


def test_expected_replies_cover_all_44_nexstar_manual_commands() -> None:
    names = [name for name, *_ in rows("nexstar_forms.txt") if not name.startswith("no_response")]
    assert [name for name, *_ in rows("nexstar_replies.txt")] == names
    since = {name: version for name, _, version, _ in rows("nexstar_forms.txt")}
    assert all(since[name] == version for name, _, version, _ in rows("nexstar_replies.txt"))
    assert len(rows("nexstar_models.txt")) == 44
