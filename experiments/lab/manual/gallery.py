"""The gallery: a player of the recommended planner's plan of each scene, beside its pages."""

from pathlib import Path

from cocap_opt.experiments.lab.studies.drawings import recommended
from cocap_opt.planners import RECOMMENDED
from cocap_opt.player.player import Player
from cocap_opt.scenarios import SCENES

SHOWN = ("corridor", "bottleneck", "passage", "bridge", "field")


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
        problem, plan = recommended(name)
        Player(problem, [(RECOMMENDED, plan)]).save(folder / f"{name}.html")
