"""What sensors say, made usable, whatever the middleware: pairing, depth filter, odometry, image decoding; pure."""
