"""The reconros command."""
