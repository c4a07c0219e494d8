"""Connection to robots over ROS 1.

Only `graph`, `installation`, `interface`, `master`, `readiness` and `service_call` can be imported without ROS.
"""
