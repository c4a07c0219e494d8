"""Decoding, matching, filtering and calibration of camera images."""
