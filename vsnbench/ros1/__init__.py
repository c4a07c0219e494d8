"""All that speaks ROS 1: link, nodes, messages, services."""
