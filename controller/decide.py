"""Scene, path and state -> Decision."""

from controller.decision import Action, Decision, Reason

__all__ = ["Action", "Decision", "Reason"]
