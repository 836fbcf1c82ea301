"""One emulated board as a process."""
