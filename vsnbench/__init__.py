"""vsnbench: does a visual-semantic-navigation model work on a real robot?"""

__version__ = "0.1.0"
