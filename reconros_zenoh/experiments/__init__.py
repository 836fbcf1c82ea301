"""The experiments of the papers; comparisons, Compose files in virtual time, and calibration."""
