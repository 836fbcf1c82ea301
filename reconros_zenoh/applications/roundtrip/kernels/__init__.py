"""The computations of the five callbacks: pure functions of numpy arrays, safe in any thread, free of ROS."""
