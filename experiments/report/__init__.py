"""Pictures of scenes, plans and results: figures, the player, and the page of a sweep."""

__all__ = ["benchmark", "charts", "explaining", "figures", "player", "rendering", "report", "style"]
