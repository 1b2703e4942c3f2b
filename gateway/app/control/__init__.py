"""The control endpoint, by which commands such as ``mount-gateway stop`` reach running gateways.

Each gateway listens for datagrams on a loopback port of its own; datagrams need no file descriptor per caller. It
writes the port and a secret into endpoint files that only its user can read, in its state folder and in every runtime
folder. Requests and answers are text, authenticated with the secret, so that no other user can forge them.
"""
