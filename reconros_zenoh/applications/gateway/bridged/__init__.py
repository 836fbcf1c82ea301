"""A ReconROS project folder."""
