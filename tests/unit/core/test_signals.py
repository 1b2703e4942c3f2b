"""Signals: everybody who is connected has acted when ``emit`` returns, in order."""

from __future__ import annotations

import pytest

from gateway.core.signals import Signal


def test_listeners_act_in_the_order_in_which_they_were_connected() -> None:
    signal, said = Signal[int](), list[str]()
    signal.connect(lambda value: said.append(f"first {value}"))
    signal.connect(lambda value: said.append(f"second {value}"))
    signal.emit(3)
    assert said == ["first 3", "second 3"]


def test_who_is_disconnected_is_told_no_more() -> None:
    signal, said = Signal[int](), list[int]()
    signal.connect(said.append)
    signal.emit(1)
    signal.disconnect(said.append)
    signal.emit(2)
    assert said == [1]


def test_who_connects_while_it_happens_is_told_the_next_time() -> None:
    signal, said = Signal[int](), list[int]()
    signal.connect(lambda _: signal.connect(said.append))
    signal.emit(1)
    assert said == []
    signal.emit(2)
    assert said == [2]


def test_what_a_listener_raises_reaches_whoever_emits() -> None:
    signal = Signal[None]()

    def fail(_: None) -> None:
        raise ValueError("no")

    signal.connect(fail)
    with pytest.raises(ValueError, match="no"):
        signal.emit(None)
