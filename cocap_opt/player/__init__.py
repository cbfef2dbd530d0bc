"""The player: plans played in a browser, in one self-contained HTML page."""
