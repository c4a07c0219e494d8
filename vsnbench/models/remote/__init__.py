"""Policies in other processes, on this or another machine, over a WebSocket (docs/wire.md)."""
