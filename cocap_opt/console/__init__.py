"""The terminal: its streams, progress, threads, and the versions of what is installed."""
