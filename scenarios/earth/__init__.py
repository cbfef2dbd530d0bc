"""The Earth: reference systems, units, and the place of a scene on it."""
