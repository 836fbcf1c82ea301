"""The project without a gateway: all subscribers read the software-mapped topic."""
