"""The model of one board: workers, slots, memory, cores, DDS stack, and its daemon-independent wiring."""
