"""Scene, path and state -> Decision: how fast to go now, and why (decide.py is where it begins)."""
