"""ReconROS projects that ship with the library."""
