"""ROS 1: messages, nodes and sensor processing of the paper's stack."""
