"""Fixed cameras in rooms, compared with the placements of lab-camera-optimizer."""

__all__ = ["tripods"]
