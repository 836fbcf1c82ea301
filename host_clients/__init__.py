"""The desktop side of the round-trip experiment: one closed-loop client per callback."""
