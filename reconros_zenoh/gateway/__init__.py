"""The gateway between a software-mapped and a hardware-mapped topic: pure, no clock, no thread, no I/O."""
