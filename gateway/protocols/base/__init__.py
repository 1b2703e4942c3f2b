"""What all protocols build on: the surface that programs talk to, the driver that talks to mounts, and framing."""
