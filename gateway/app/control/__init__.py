"""How a command of this program reaches the gateways that run: ``mount-gateway stop``, for one.

A gateway listens on a loopback port of its own for datagrams, which need no descriptor for every caller, and writes the
port and a secret into files that only its user can read: in its state folder and in every runtime folder. A question is
a word, an answer is text, and both are sealed with the secret, so that nobody else can give either.
"""

from gateway.app.control.client import ask
from gateway.app.control.endpoints import ControlEndpoint, doors, sweep
from gateway.app.control.server import Control

__all__ = ["Control", "ControlEndpoint", "ask", "doors", "sweep"]
