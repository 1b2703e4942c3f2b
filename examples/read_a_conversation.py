"""Decode a conversation between a program and a mount, and build frames of both protocols.

Run it: ``python examples/read_a_conversation.py``. It opens no port and needs no mount.
"""

from __future__ import annotations

from gateway import FrameError, Splitter, decode, decode_reply, encode, encode_reply

#: What a planetarium program sends to point at the Crab nebula, in the pieces in which it arrived.
SENT = (b":GR", b"#:Sr05:34:32#:Sd+22", b"*00:52#:MS#")
#: What a Meade answers to each of these commands.
REPLIES = (b"04:12:07#", b"1", b"1", b"1Object Below Horizon.#")


def main() -> None:
    splitter = Splitter("lx200")
    commands = [command for piece in SENT for command in splitter.feed(piece)]
    for command, reply in zip(commands, REPLIES, strict=True):
        asked = decode("lx200", command)
        told = decode_reply("lx200", asked.name, reply)
        print(f"{command.decode():16} {asked.help}: {dict(asked.values) or 'no values'}")
        print(f"  {reply.decode():14} {told.fault or 'done'}: {dict(told.values) or 'no values'}")

    # The same position as each protocol writes it: degrees in, bytes out.
    print(encode("nexstar", "r", ra=83.6333, dec=22.0144))
    print(encode_reply("lx200", "GR", ra=83.6333), encode_reply("lx200", "GR", precision="low", ra=83.6333))

    try:
        decode("lx200", b":Sr25:00:00#")
    except FrameError as error:
        print(f"not understood: {error}")


if __name__ == "__main__":
    main()
