"""The predicted accuracy of plans compared with noisy pictures of walkers, and quality with J."""

__all__ = ["figure", "quality"]
