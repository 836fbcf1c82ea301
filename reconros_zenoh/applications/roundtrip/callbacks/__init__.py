"""The five callbacks, each in a software and a hardware version (ReconROS Executor, Section V-A)."""
