"""Encoding of values and images for files and sockets."""
