"""Files of this project: JSON with a version, written whole or not at all."""
