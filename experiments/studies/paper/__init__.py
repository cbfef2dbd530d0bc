"""The experiments of the CoCap paper, made again over many seeds and answered with bounds."""
