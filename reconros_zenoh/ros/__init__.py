"""What ROS 2 is on the wire of rmw_zenoh: names, QoS, types and CDR, graph tokens, attachments."""
