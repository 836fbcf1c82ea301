"""Training of the round trip's digit classifier: needs the extra `training`, never used at run time."""
