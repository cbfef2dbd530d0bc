"""What a camera sees: projection, visibility, coverage of all states, rendering."""
