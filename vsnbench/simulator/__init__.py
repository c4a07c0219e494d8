"""The embedded world: a site file becomes a scene with physics, a camera and odometry."""
