"""Detection: what is at the other end of a serial port, asked so that nothing can move and nobody is disturbed.

``probe`` is the law of asking, ``identify`` lets the real driver ask on, ``scan_port`` is one port from opening to
closing, ``ports`` says which ports there are, ``report`` puts the findings into words. Nothing else in the gateway may
ask an unknown line anything.
"""

from __future__ import annotations

from gateway.diagnostics.detect.ports import SerialPortInfo, here, named
from gateway.diagnostics.detect.scan_port import BUSY, Finding, look, look_at_all, who_answers

__all__ = ["BUSY", "Finding", "SerialPortInfo", "here", "look", "look_at_all", "named", "who_answers"]
