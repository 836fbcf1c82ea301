"""Each node of Fig. 5 where the mapping wants it."""

from reconros_zenoh.applications.gateway.nodes import run_nodes as main

__all__ = ["main"]
