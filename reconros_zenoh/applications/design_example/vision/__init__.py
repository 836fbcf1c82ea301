"""The board with the slots: /filter and /inv_kinematics."""
