"""How fragments and bodies move over ground, and what that proves."""
