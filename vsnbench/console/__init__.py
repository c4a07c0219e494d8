"""Pages beside the work, for a browser here or a phone in the lab: they drive the rooms below and hold no rule."""
