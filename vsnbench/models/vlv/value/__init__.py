"""VLV's value network."""
