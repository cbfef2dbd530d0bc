"""The experiments of the CoCap paper, made again over many seeds and answered with bounds."""

__all__ = ["answers", "figures", "giving_way", "reproduction"]
