"""The operator of a session: questions, answers and progress, on a terminal or a web page."""
