"""Pictures of scenes, plans and results: figures, the player, and the page of a sweep."""

__all__ = [
    "benchmark",
    "charts",
    "figures",
    "limitations",
    "pages",
    "player",
    "player_scene",
    "rendering",
    "report",
]
