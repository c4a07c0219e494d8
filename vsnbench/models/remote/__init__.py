"""Policies that run in a process of their own, here or on another machine, behind a WebSocket (docs/wire.md)."""
