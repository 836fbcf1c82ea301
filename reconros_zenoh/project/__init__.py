"""The files of a ReconROS project: `build.cfg`, interfaces and mappings."""
