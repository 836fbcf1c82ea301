"""The model of one board: executor, workers, slots, memory, cores, DDS stack, topics and gateways."""
