"""The board of the control loop: /pid_ctrl and /actor_driver."""
