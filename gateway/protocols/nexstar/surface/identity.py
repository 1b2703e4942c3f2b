"""Who the presented hand control is: version, variant, model, echo. Synthesised from the presented model."""

from __future__ import annotations

from typing import Any

from gateway.protocols.base.surface import Session
from gateway.protocols.wireformat.command import Command


def version(session: Session, command: Command, values: dict[str, Any]) -> dict[str, int]:
    """V"""
    major, minor = session.model["version"]
    return {"major": major, "minor": minor}


def variant(session: Session, command: Command, values: dict[str, Any]) -> dict[str, int]:
    """v - answered whatever the version: one program waits five seconds for it, twice."""
    return {"variant": session.model["variant"]}


def model(session: Session, command: Command, values: dict[str, Any]) -> dict[str, int]:
    """m"""
    return {"model": session.model["id"]}


def echo(session: Session, command: Command, values: dict[str, Any]) -> dict[str, int]:
    """K"""
    return values
