"""Robot sensor data without a middleware: images, odometry, maps, movements."""
