"""The design example of ReconROS Executor, Section IV: six nodes on two boards and a desktop."""
