"""The terminal: streams, progress, threads, usage lines, and versions of what is installed."""
