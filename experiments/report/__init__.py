"""Reports of sweeps: HTML pages and charts of the results in their folders."""
