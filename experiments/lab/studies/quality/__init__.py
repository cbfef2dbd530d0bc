"""The predicted accuracy of plans held to noisy pictures of walkers, and quality beside J."""

__all__ = ["figure", "quality"]
