"""`vsnbench doctor`: checks of a robot before trials."""
