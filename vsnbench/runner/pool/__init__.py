"""Several trials at once: workers on this machine or on a cluster, and the driver that hands the trials out."""
