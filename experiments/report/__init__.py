"""Reports of sweeps: pages of HTML and charts of what their folders hold."""
