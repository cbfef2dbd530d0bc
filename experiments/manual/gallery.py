"""The gallery: a player of the recommended planner's plan of each scene, beside its pages."""

from pathlib import Path

from cocap_opt.experiments.report.player import Player
from cocap_opt.planners import PLANNERS, RECOMMENDED
from cocap_opt.scenarios import SCENES, load_scene
from cocap_opt.stop import TimeLimit

SHOWN = ("corridor", "bottleneck", "passage", "bridge", "field")
_SECONDS = 20.0  # for each plan; they take a second


def gallery_in_markdown() -> str:
    """Returns a part for each scene, with its player in a frame."""
    return "\n\n".join(map(_part, SHOWN))


def _part(name: str) -> str:
    about = " ".join((SCENES[name].__doc__ or "").split())
    return (
        f"## {name}\n\n{about}\n\n"
        f'<iframe class="player" src="players/{name}.html" title="{name}" loading="lazy"></iframe>'
        f'\n\n<a href="players/{name}.html">The player of {name} on a page of its own</a>'
    )


def write_players(folder: Path) -> None:
    """Plans each scene of the gallery, and writes its player into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in SHOWN:
        problem = load_scene(name, 0)
        plan = PLANNERS[RECOMMENDED](problem, TimeLimit(_SECONDS)).plan
        assert plan is not None, f"{name}: has no plan"
        Player(problem, [(RECOMMENDED, plan)]).save(folder / f"{name}.html")
