"""The player: plans of one scene in one HTML file, which needs no network and no other file.

The scripts in the folder `page` draw; this module makes the data that they draw.
"""

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from cocap_opt.files.documents import FileError
from cocap_opt.formulations.explanation import Explanation
from cocap_opt.output.files import save_bytes
from cocap_opt.output.heights import over_datum
from cocap_opt.player.pages import inert, page_text, style_text
from cocap_opt.player.player_filmed import filmed
from cocap_opt.player.player_plan import PlayerPlan, digits
from cocap_opt.player.player_proof import Proof
from cocap_opt.player.player_scene import PlayerScene
from cocap_opt.player.scripts import bundled
from cocap_opt.problem import Cone, Plan, Problem

_FRAME_HEIGHT = 680  # px, in a notebook

Data = dict[str, Any]
Titled = tuple[str, Plan]  # a title and a plan


class Player:
    """Plays plans of one scene side by side: inline in a notebook, or from a file.

    Parameters
    ----------
    plans : plans with titles, none with violations by `check`. Without any plan the drones are
        shown at their starts; for drones that may choose their start, the ground above which they
        may start
    gaps : the terms of each plan's gap, None where they are unknown (default: none)
    planners : the planner of each plan, None where it is unknown (default: none)
    cut_short : the effect of a limit on each plan, in words (default: none)
    proof : the file that proves the bound of `gaps`; the page offers it for download

    Examples
    --------
    >>> problem = co.load("corridor")
    >>> plans = [co.plan(problem, name) for name in ("greedy", "cocap")]
    >>> co.show(problem, *plans).save("plans.html")
    """

    def __init__(
        self,
        problem: Problem,
        plans: Sequence[Titled] = (),
        gaps: Sequence[Explanation | None] = (),
        planners: Sequence[str | None] = (),
        cut_short: Sequence[str] = (),
        proof: Proof | None = None,
    ) -> None:
        self._problem = problem if plans else _without_goals(problem)
        self._waits = not plans
        self._absent: frozenset[int] = frozenset() if plans else problem.open_starts
        words = "drones at their starts"
        if len(self._absent) == len(problem.robots):
            words = "where drones may start"
        self._plans = plans or [(words, _waiting(problem))]
        self._gaps = gaps or [None] * len(self._plans)
        self._planners = planners or [None] * len(self._plans)
        self._cut_short = cut_short or [""] * len(self._plans)
        self._proof = proof
        self._judged = problem if plans else _without_distance_to_people(self._problem)

    @property
    def scene(self) -> str:
        """Name of the scene."""
        return self._problem.name

    def page(self) -> str:
        """Returns the text of the HTML file."""
        parts = {
            "style": style_text("player.css"),
            "script": bundled("player"),
            "data": inert(self.data()),
        }
        return page_text("player.html", parts)

    def data(self) -> Data:
        """Returns all data that the player draws, as one JSON object.

        Lengths are in m, angles in rad, and positions in the coordinates of `PlayerScene`; plans
        are the data of `PlayerPlan`. Gaps are shares of the bound. `seconds` is the length of a
        step, None if the scene does not define it.
        """
        problem, scene = self._problem, PlayerScene(self._problem)
        plans = [
            PlayerPlan(scene, self._judged, plan, gap, self._absent)
            for (_, plan), gap in zip(self._plans, self._gaps, strict=True)
        ]
        shown: list[Data] = [
            {"title": title, "planner": planner, "waits": self._waits, "cutShort": cut_short,
             "filmed": None if self._waits else filmed(problem, flown)}
            | plan.data()
            for (title, flown), planner, cut_short, plan in zip(
                self._plans, self._planners, self._cut_short, plans, strict=True
            )
        ]  # fmt: skip
        return {
            "name": problem.name,
            "about": _about(problem),
            "steps": problem.horizon,
            "seconds": problem.step,
            "first": problem.first_step,
            "layers": len(problem.layers),
            "over": over_datum(problem),
            "isOnEarth": problem.earth is not None,
            "unit": _unit(problem),
            "most": digits(max(float(plan.seen.max(initial=0.0)) for plan in plans)) or 1.0,
            "mostReward": max(max(plan["rewards"]) for plan in shown),
            **scene.scope([plan for _, plan in self._plans], self._absent),
            "terrain": scene.terrain(),
            "starts": scene.starts() if self._absent else None,
            **scene.meshes(),
            "airspace": scene.airspace(),
            "people": [scene.person(j) for j in range(len(problem.actors))],
            "tasks": scene.tasks(),
            "drones": [scene.drone(number) for number in range(len(problem.robots))],
            "plans": shown,
            "certificate": None if self._proof is None else self._proof.data(),
        }

    def save(self, path: Path | str) -> None:
        """Writes the HTML file.

        Raises
        ------
        FileError
            If it cannot be written, or is not named .html; one line with its name.
        TypeError
            If the path is none.
        """
        if not isinstance(path, str | Path):
            raise TypeError(f"path: must be the name of a file, not {path!r}")
        if Path(path).suffix.lower() not in (".html", ".htm"):
            raise FileError(f"{path}: must be named .html; `problem.plot(plan)` draws a picture")
        save_bytes(Path(path), self.page().encode())

    def __repr__(self) -> str:
        titles = " | ".join(title for title, _ in self._plans)
        return f"Player of {self._problem.name!r}: {titles}; .save(path) writes it as an HTML file"

    def _repr_html_(self) -> str:
        """Plays inline in a notebook, in a frame that contains the whole page."""
        page = escape(self.page(), quote=False).replace("'", "&#x27;")  # it has few single quotes
        return (
            f"<iframe srcdoc='{page}' title=\"plans of {escape(self._problem.name)}\" "
            f'width="100%" height="{_FRAME_HEIGHT}" style="border: 0"></iframe>'
        )


def _waiting(problem: Problem) -> Plan:
    """Returns the plan in which all drones stay at their starts."""
    return Plan(paths=tuple((state,) * (problem.horizon + 1) for state in problem.first_starts))


def _without_goals(problem: Problem) -> Problem:
    """Returns the problem in which drones may stay at their starts."""
    return problem.replace(robots=tuple(robot.replace(goal=None) for robot in problem.robots))


def _without_distance_to_people(problem: Problem) -> Problem:
    """Returns the problem without the distance to people, so drones may stay at their starts."""
    airspace = problem.airspace.replace(people_aside=0.0, people_above=None)
    return problem.replace(airspace=airspace)


def _unit(problem: Problem) -> str:
    """Returns the unit of coverage, which is not pixels for cones."""
    cones = [isinstance(robot.camera, Cone) for robot in problem.robots]
    return "1/m²" if all(cones) else "px/m² or 1/m²" if any(cones) else "px/m²"


def _about(problem: Problem) -> str:
    """Returns the numbers of drones, people and steps in words."""
    counts = ((len(problem.robots), "drone", "drones"), (len(problem.actors), "person", "people"),
              (problem.horizon, "step", "steps"))  # fmt: skip
    words = ", ".join(
        f"{count} {singular if count == 1 else plural}" for count, singular, plural in counts
    )
    return f"{words}, {len(problem.takes)} takes" if problem.takes else words
