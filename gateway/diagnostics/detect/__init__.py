"""Detection: find out what is connected to a serial port without moving a mount or disturbing another device.

``probe`` decides which bytes may be sent to an unknown device, ``identify`` lets the real driver continue,
``scan_port`` examines one port from opening to closing, ``ports`` lists the ports, ``report`` describes the findings.
No other part of the gateway may send anything to an unknown device.
"""

from __future__ import annotations

from gateway.diagnostics.detect.ports import SerialPortInfo, local_ports, parse_port
from gateway.diagnostics.detect.scan_port import BUSY, PortFinding, ask_servers, look, look_at_all, who_answers

__all__ = [
    "BUSY",
    "PortFinding",
    "SerialPortInfo",
    "ask_servers",
    "local_ports",
    "look",
    "look_at_all",
    "parse_port",
    "who_answers",
]
