"""ROS 2 nodes and their endpoints over any Transport, on the wire as rmw_zenoh has them."""
