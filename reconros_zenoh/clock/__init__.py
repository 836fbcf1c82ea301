"""The one event loop, in virtual time or held to the monotonic clock; signals; how a process begins."""
