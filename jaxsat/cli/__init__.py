"""The command line: one file a command; JAX is imported only when a command runs."""

from jaxsat.cli.entry import main

__all__ = ["main"]
