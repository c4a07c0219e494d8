"""Control law of discrete_move (paper, Section 3.1.3), independent of robots and clocks."""
