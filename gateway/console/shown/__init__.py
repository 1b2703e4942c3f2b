"""What pages are shown: the state of every mount, made once for all pages, in pieces that hold up no program."""
