"""The LX200 surface and codecs against the Meade manual, typed by hand."""

from __future__ import annotations

import datetime
import re

import pytest

from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.fields import codec
from tests.support.each import each
from tests.support.fake_mount import Talk
from tests.support.manual_files import fits, raw, rows
from tests.support.sampling import as_a_rule

LX200 = load("lx200")
_PICTURES = {"sHH": "sHH.H", "DDD*MM'SS": "DDD*MM:SS", "DD*": "DD*"}


def test_all_145_request_forms_of_the_meade_manual_have_a_row() -> None:
    forms = rows("lx200_forms.txt")
    assert len(forms) == 145
    for name, example, _, _ in forms:
        found = LX200.find(raw(example))
        assert found is not None, example
        assert found[0].name == name, example
        assert found[0].beyond is None


def test_lx200_surface_answers_every_form_of_the_manual() -> None:
    assert LX200.commands.keys() == LX200.surface_rows.keys()


@pytest.mark.parametrize("model", ["autostar", "lx200", "lx200-16", "lx200gps"])
def test_lx200_surface_replies_in_the_formats_that_programs_expect(model: str) -> None:
    wrong = []
    for name, example, models, shapes in rows("lx200_forms.txt") + rows("lx200_beyond.txt"):
        found = LX200.find(raw(example))
        if found is None or (models != "-" and model not in models.split(",")):
            continue
        reply = Talk(model=model).send(raw(example))
        if not fits(reply, shapes):
            wrong.append((name, example, reply, shapes))
    assert wrong == []


@each("models, said, shapes", rows("lx200_library.txt"))
def test_lx200_surface_answers_library_moon_and_help_commands_as_the_manual_says(
    models: str, said: str, shapes: str
) -> None:
    """As a rule one of the models, each in turn."""
    names = models.split(",")
    every = as_a_rule(len(names), whole=1)
    for model in names[len(said) % every :: every]:
        reply = Talk(model=model).send(raw(said))
        assert fits(reply, shapes), (model, reply)


def test_lx200_surface_knows_all_unofficial_commands_that_need_a_reply() -> None:
    for name, example, _, shapes in rows("lx200_beyond.txt"):
        assert LX200.find(raw(example)) is not None or "-" in shapes.split(" ~ "), name


def _value(text: str, picture: str) -> object:
    if picture == "MM/DD/YY":
        return datetime.date.fromisoformat(text)
    try:
        return float(text)
    except ValueError:
        return text


def _tolerance(picture: str) -> float:
    return 1e-9


@each("way, picture, data, value", rows("lx200_fields.txt"))
def test_lx200_field_is_coded_as_the_manual_writes(way: str, picture: str, data: str, value: str) -> None:
    form = codec(_PICTURES.get(picture, picture))
    if way == "bad":
        with pytest.raises(ValueError, match=r"."):
            _ = form.decode(raw(data)) if re.fullmatch(form.pattern, raw(data), re.DOTALL) else int("refused")
    elif way == "in":
        assert (
            form.decode(raw(data)) == pytest.approx(_value(value, picture))
            if picture != "MM/DD/YY"
            else (form.decode(raw(data)) == _value(value, picture))
        )
    else:
        assert form.encode(_value(value, picture)) == raw(data)
