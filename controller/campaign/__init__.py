"""Thousands of closed-loop missions, several policies on the same ones, judged against an oracle."""
