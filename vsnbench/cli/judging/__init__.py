"""`vsnbench judge`: first and second judgements of recorded episodes."""
