"""Fixed cameras in rooms, beside those that lab-camera-optimizer places."""

__all__ = ["tripods"]
