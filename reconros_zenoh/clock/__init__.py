"""The one event loop: jumping in virtual time or held to the monotonic clock."""
