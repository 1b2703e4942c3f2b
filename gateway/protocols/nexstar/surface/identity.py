"""Who the presented hand control is: version, model, echo. Synthesised from the presented model."""

from __future__ import annotations

from gateway.core.operations import Values
from gateway.protocols.nexstar.session import NexStarSession
from gateway.protocols.wireformat.command import Command


def version(session: NexStarSession, command: Command, values: Values) -> dict[str, int]:
    """V"""
    major, minor = session.model["version"]
    return {"major": major, "minor": minor}


def model(session: NexStarSession, command: Command, values: Values) -> dict[str, int]:
    """m"""
    return {"model": session.model["id"]}


def echo(session: NexStarSession, command: Command, values: Values) -> dict[str, int]:
    """K"""
    return values
