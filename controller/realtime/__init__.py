"""The real-time runner: the loop, the perception process beside it, and what a service owes its manager."""
