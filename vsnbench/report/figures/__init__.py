"""The figures of a report: vector drawings for a two-column paper, told apart by shape as well as by colour."""
