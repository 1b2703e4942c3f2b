"""How commands such as ``mount-gateway stop`` reach the gateways that are running.

Each gateway listens for datagrams on a loopback port of its own; datagrams need no file descriptor per caller. It
writes the port and a secret into endpoint files that only its user can read, in its state folder and in every runtime
folder. Requests and answers are text, sealed with the secret, so that nobody else can forge either.
"""
