"""Ports for clients: TCP, RFC 2217, a pseudo-terminal with a stable name, a real serial port.

A port depends on no protocol. For every connection it calls ``accept`` to get a handler, passes received bytes to the
handler, and sends what the handler writes. Clients connect and disconnect at any time; no connection affects another.
"""

from __future__ import annotations

from gateway.core.errors import UserError
from gateway.transport.handler import Accept, ConnectionHandler, Listener
from gateway.transport.serial_port import SerialPort
from gateway.transport.tcp import TcpPort

__all__ = ["Accept", "ConnectionHandler", "Listener", "open_port"]


async def open_port(address: str, accept: Accept, baud: int | None = None) -> Listener:
    """Open ``tcp://`` or ``rfc2217://HOST:PORT``, ``pty:PATH`` or a serial port. Raises UserError with the reason.

    ``baud`` is for the last two. Without it, a pseudo-terminal accepts any rate, and a serial port has 9600 baud.
    """
    if address.startswith("tcp://"):
        return await TcpPort.open(address, accept)
    if address.startswith("rfc2217://"):
        from gateway.transport.rfc2217 import with_telnet

        return await TcpPort.open(address, with_telnet(accept))
    if address.startswith("pty:"):
        if not address[4:]:
            raise UserError("pty: needs a path, for example pty:/tmp/lx200")
        from gateway.transport.pty import PtyPort

        return PtyPort(address[4:], accept, baud)
    if "://" not in address and not address.upper().startswith(("/", "~", ".", "COM", "\\\\.\\")):
        raise UserError(f"{address}: write tcp://HOST:PORT, rfc2217://HOST:PORT, pty:PATH or the name of a serial port")
    return await SerialPort.open(address, accept, baud or 9600)
