"""A ReconROS project: reading `build.cfg`, interfaces, mappings and main.py, and putting it on a board."""
