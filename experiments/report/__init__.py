"""Pictures: figures, the player, and the page that is made of a sweep."""
