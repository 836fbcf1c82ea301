"""What was measured: records of round trips, their statistics, the real board's figures, and reports."""
