"""Bases at the other end of their wires: each speaks its real protocol."""
