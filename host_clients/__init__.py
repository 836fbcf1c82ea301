"""The desktop side of the experiments: a closed-loop client per callback; camera, viewer, scope, robot."""
