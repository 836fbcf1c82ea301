"""The round-trip application: five callbacks and their clients (ReconROS Executor, Section V)."""
