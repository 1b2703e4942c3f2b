"""The tables of ``gateway.toml`` that are about neither a mount nor a surface, a module for the keys of each."""
