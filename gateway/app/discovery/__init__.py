"""Announces surfaces and web pages on the network, so that programs on other computers find them."""
