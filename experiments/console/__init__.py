"""The terminal: streams, progress, numbers in options."""
