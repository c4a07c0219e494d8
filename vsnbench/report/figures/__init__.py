"""Vector figures of a report for a two-column paper; conditions differ in shape and colour."""
