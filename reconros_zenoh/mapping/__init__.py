"""Communication mapping: which topic of a ROS application is realised in software, in hardware, or both."""
