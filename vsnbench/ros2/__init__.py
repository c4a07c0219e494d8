"""All that speaks ROS 2: the link to a robot, the nodes, and what a check-up looks at."""
