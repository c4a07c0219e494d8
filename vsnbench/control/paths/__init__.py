"""Following of curved paths: one from rest to rest, and paths that replace each other."""
