"""The executors of the paper: pure, no clock, no thread, no input or output."""
