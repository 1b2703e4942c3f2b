"""Rehearsals: every row can be explained, and what is explained is what the mount was sent."""

from __future__ import annotations

import pytest

from gateway.diagnostics.rehearsal.explain import explain
from gateway.diagnostics.rehearsal.samples import example_request
from gateway.protocols.registry import protocol_pairs
from gateway.protocols.wireformat.command_set import load
from tests.support.sampling import as_a_rule


@pytest.mark.parametrize(("client", "mount"), protocol_pairs())
def test_explain_describes_each_command_of_a_protocol(client: str, mount: str) -> None:
    asked = [item for item in load(client).commands.items() if item[1].requested]
    for name, command in asked[:: as_a_rule(18, whole=1)]:
        told = explain(client, mount, "".join(f"\\x{byte:02x}" for byte in example_request(command))).text
        assert command.help in told, name
        assert ": missing" not in told, name
        assert "\nreply: " in told, name


def test_explain_lists_the_requests_sent_to_the_mount_for_a_command() -> None:
    told = explain("lx200gps", "cge", ":TL#").text  # FFFD hexadecimal is the lunar rate of the azimuth motor
    assert "P\\x03\\x10\\x06\\xff\\xfd\\x00\\x00" in told
    assert explain("lx200", "cge", "\\x06").text.endswith("reply: P  (polar)")
    small = explain("lx200", "gt/101.0", ":Mn#").text
    assert "to the mount: R" in small and "P\\x02" not in small
    assert "to the mount: and so on" in small
    home = explain("lx200gps", "6se", ":hF#").text
    assert "after :hS#, with the Crab nebula" in home and "No home position" not in home


def test_explained_read_shows_what_the_mount_is_asked() -> None:
    assert "to the mount: e  precise" in explain("nexstar", "cpc", "e").text
    told = explain("lx200", "lx200gps", ":GVP#").text  # no model is named: the mount itself is what programs see
    assert "answered by the mount itself" in told and told.endswith("reply: LX2001#")
    assert explain("nexstar", "lx200:lx200", "m").text.endswith("\\x09#  (cpc)")  # a polar Meade: a CPC on a wedge
