"""BioTac fingertips in ROS 2."""
