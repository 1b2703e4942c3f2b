"""Signals: everybody who is connected has acted when ``emit`` returns, in order."""

from __future__ import annotations

import pytest

from gateway.core.signals import Signal


def test_signal_calls_its_listeners_in_the_order_of_connection() -> None:
    signal, said = Signal[int](), list[str]()
    signal.connect(lambda value: said.append(f"first {value}"))
    signal.connect(lambda value: said.append(f"second {value}"))
    signal.emit(3)
    assert said == ["first 3", "second 3"]


def test_disconnected_listener_is_not_called() -> None:
    signal, said = Signal[int](), list[int]()
    signal.connect(said.append)
    signal.emit(1)
    signal.disconnect(said.append)
    signal.emit(2)
    assert said == [1]


def test_listener_connected_during_a_signal_is_called_the_next_time() -> None:
    signal, said = Signal[int](), list[int]()
    signal.connect(lambda _: signal.connect(said.append))
    signal.emit(1)
    assert said == []
    signal.emit(2)
    assert said == [2]


def test_exception_of_a_listener_reaches_the_emitter() -> None:
    signal = Signal[None]()

    def fail(_: None) -> None:
        raise ValueError("no")

    signal.connect(fail)
    with pytest.raises(ValueError, match="no"):
        signal.emit(None)
