"""The state of every mount for the pages: made once for all of them, in small steps that delay no client."""
