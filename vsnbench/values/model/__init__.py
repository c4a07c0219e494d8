"""What a model states about itself: its card, and the camera that it was trained with."""
