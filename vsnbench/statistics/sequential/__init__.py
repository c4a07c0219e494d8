"""Tests that hold at every look: bets, and sign flips at a few looks."""
