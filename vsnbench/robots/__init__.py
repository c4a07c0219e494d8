"""What carries out actions and senses, and the profiles of the robots we know."""
