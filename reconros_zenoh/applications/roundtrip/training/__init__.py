"""Training of the round trip's digit classifier: needs what `train` says, never used at run time."""
