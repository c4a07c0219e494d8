"""The report of a study: the locked plan, what became of it, its primary analysis, and everything else apart."""
