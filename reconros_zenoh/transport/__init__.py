"""How messages travel: `base` is the waist everything else sees, `simulated` and `zenoh` are behind it."""
