"""discrete_move's control law (paper, Section 3.1.3): pure, no robot and no clock of its own."""
