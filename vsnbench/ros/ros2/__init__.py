"""Connection to robots over ROS 2.

Only `docking`, `graph`, `installation`, `interface`, `readiness`, `topic_service` and `velocities` can be imported
without ROS.
"""
