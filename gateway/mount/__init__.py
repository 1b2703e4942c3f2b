"""One mount: what is wanted of it, what is allowed, what is seen, and where and when it stands."""
