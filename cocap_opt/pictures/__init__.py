"""Pictures of scenes and plans, drawn with matplotlib or rendered as a camera sees them."""
