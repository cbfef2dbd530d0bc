"""The player: plans played in a browser, in one HTML page that needs nothing else."""
