"""ReconROS without the board: ROS 2 callbacks on emulated CPU+FPGA boards over Zenoh."""
