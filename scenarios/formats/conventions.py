"""Conventions of a scene of Greedy Perspectives for which there are two choices: theirs and ours.

Source: Suresh et al., "Greedy Perspectives", 2024 (arXiv 2310.10863), and the behaviour of its
program. The reader, `cocap_opt.scenarios.formats.greedy_perspectives`, translates mere differences
of notation (headings, angles of tilt, cells).
"""

from collections.abc import Mapping
from typing import Literal, NamedTuple

from cocap_opt.problem import VERTEX_ONLY, CollisionRules
from cocap_opt.scenarios.formats import NO_YES, YES_NO, Options


class Conventions(NamedTuple):
    """The meaning of a scene of Greedy Perspectives; the defaults are those of its program.

    Only the default of `tilt` differs, because the tilts in their program result from an error.

    Attributes
    ----------
    triangles
        True: each rectangle of an actor is two faces, each with its own square root. Their program
        has 12 triangles; the two at the bottom, which no camera above ground sees, are omitted
        here, so 10 faces remain. False: four sides and a top.
    count_start
        True: the views of the start poses, which no plan can change, are part of J. Their program
        counts them: its H rows are the start and H - 1 moves.
    tilt
        "own": each robot's camera has the tilt that the file gives it. "first": all cameras have
        the tilt of robot 0. The coverage cache of their program ignores which robot asks, so the
        robot that first reaches a state fixes the tilt there for all robots: robot 0 wherever it
        can be, others elsewhere. The rewards that they report therefore lie between the two: on
        `corridor` 4.2 % below "own" ("first": 11.9 % below), on `split` 3.7 % above ("first": 14.0
        % above).
    rules
        The collision rules. Theirs: no two robots are in one cell at one step (`VERTEX_ONLY`).
        Ours: in addition, no two robots exchange their cells.
    corner_cutting
        True: a diagonal move may cut the corner of a blocked cell.
    start_set
        "seed": the seed chooses a set of `starts.csv`; without that file, the poses in the scene's
        own file are used. "yaml": always the poses in the scene's own file.
    bonus
        True: the objective includes the 100 that their planner adds for each move with dx + dy = 0
        (`Objective.balanced`). The rewards that they report do not include it.
    """

    triangles: bool = True
    count_start: bool = True
    tilt: Literal["own", "first"] = "own"
    rules: CollisionRules = VERTEX_ONLY
    corner_cutting: bool = True
    start_set: Literal["seed", "yaml"] = "seed"
    bonus: bool = False

    @classmethod
    def of(cls, options: Mapping[str, str]) -> "Conventions":
        """Returns the conventions that the given options select, e.g. {"triangles": "no"}.

        Raises
        ------
        ProblemError
            If an option or its word is unknown; the message lists in one line what is allowed.
        """
        changes = OPTIONS.chosen(options)
        base: Conventions = changes.pop("conventions", THEIRS)
        return base._replace(**{name.replace("-", "_"): value for name, value in changes.items()})


THEIRS = Conventions()
OURS = Conventions(triangles=False, count_start=False, rules=CollisionRules(), corner_cutting=False)

OPTIONS = Options(
    {
        "conventions": {"theirs": THEIRS, "ours": OURS},  # the other options override these
        "triangles": YES_NO,
        "count-start": YES_NO,
        "tilt": {"own": "own", "first": "first"},
        "rules": {str(rules): rules for rules in (VERTEX_ONLY, CollisionRules())},
        "corner-cutting": YES_NO,
        "start-set": {"seed": "seed", "yaml": "yaml"},
        "bonus": NO_YES,
    }
)
