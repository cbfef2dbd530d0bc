"""The whole planning problem: workspace, robots, actors, objective and collision rules.

Everything here is immutable data, checked once when it is created and then trusted. The same
classes define the scene file: `cocap_opt.files.documents` reads and writes them as JSON.

Axis letters used throughout the project: R robots, T steps, S motion states, A actors,
F faces over all actors. Metres, radians, pixels. Steps are t = 0..T.

Source of the model: Rauniyar, Corah, Scherer, "CoCap: Coordinated motion Capture for
multi-actor scenes in outdoor environments", 2024 (arXiv 2412.20695), and Suresh et al.,
"Greedy Perspectives", 2024 (arXiv 2310.10863).
"""

import html
from functools import cached_property
from typing import TYPE_CHECKING, overload

import msgspec
import numpy as np

from cocap_opt.data import FloatArray, IntArray, read_only, within
from cocap_opt.problem.checks import require_scene
from cocap_opt.problem.rules import NO_RULES
from cocap_opt.problem.scene import SceneData
from cocap_opt.problem.takes import in_all_takes, of_people, told_take
from cocap_opt.returns import Returns
from cocap_opt.text import counted, printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from cocap_opt.problem.pictures import HasPaths, WholeAxes


class Problem(SceneData, frozen=True, eq=False, dict=True):
    """A view-planning problem: all data that planners, bounds and the referee need.

    Attributes
    ----------
    name : name shown in tables and pictures
    height_map : the terrain and buildings as columns
    robots : the drones
    actors : the people
    horizon : T, number of moves
    rules : the conflicts between drones that are forbidden
    objective : the weights of J, except those of the faces
    face_samples : each triangle of a face that a mesh may hide is tested with this number squared
        of sight rays; convex meshes, columns and actors need no rays
    meshes : solid matter in addition to the height map
    airspace : no-fly zones, a ceiling, and the distance that drones keep from people
    step : length of a step in seconds; None if unspecified
    earth : the scene's place on the Earth; None if unknown
    takes : alternative walks of the people, whose probabilities sum to 1; a person who belongs to
        no take gets a copy in each. None: people walk in one way only
    land_cover : areas of the ground that pictures show: water, streets and the like

    Raises
    ------
    ProblemError
        If any field is wrong; the message starts with the field's path.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        msgspec.structs.force_setattr(self, "name", printable(self.name))  # it may come from a file
        actors, objective = in_all_takes(self.takes, self.actors, self.objective)
        if actors != self.actors:
            msgspec.structs.force_setattr(self, "actors", actors)
            msgspec.structs.force_setattr(self, "objective", objective)
        require_scene(self)

    def __repr__(self) -> str:
        (x, y), views = self.height_map.shape, self.objective.views
        drones = counted(len(self.robots), "drone")
        return (
            f"Problem {self.name!r}: {drones} {'film' if len(self.robots) > 1 else 'films'} "
            f"{self.told_people} over {counted(self.horizon, 'step')}\n"
            f"on {x} x {y} cells of {self.height_map.resolution:g} m; collision rules: {self.rules}"
            f"{f'; airspace: {self.airspace}' if str(self.airspace) else ''}"
            f"{'' if views is None else f'; up to {views.cameras} drones that see a person count'}"
        )

    @property
    def told_people(self) -> str:
        """The number of people in words; with takes, the number in all of them."""
        people = counted(len(self.actors), "person")
        return f"{people} of {counted(len(self.takes), 'take')}" if self.takes else people

    def _repr_html_(self) -> str:
        """Describes the problem in a notebook, with a picture."""
        from cocap_opt.problem.pictures import TopView  # no computation needs it

        return f"<p>{html.escape(repr(self))}</p>{TopView.of(self).image()}"

    @overload
    def plot(self, plan: "HasPaths | None" = None, ax: None = None) -> "WholeAxes": ...

    @overload
    def plot(self, plan: "HasPaths | None" = None, *, ax: "Axes | None") -> "Axes": ...

    @overload
    def plot(self, plan: "HasPaths | None", ax: "Axes | None") -> "Axes": ...

    def plot(self, plan: "HasPaths | None" = None, ax: "Axes | None" = None) -> "Axes":
        """Draws the scene from above, with the flights of a plan or the drones' starts.

        For drones that may choose their start, it draws the ground above which they may start.

        Parameters
        ----------
        plan : a plan, or any object with `paths`
        ax : matplotlib axes (default: those of a new figure)
        """
        from cocap_opt.problem.pictures import TopView  # as above

        return TopView.of(self, plan).draw(ax)

    def until(self, step: int) -> "Problem":
        """Returns the problem cut off after a step; everything else stays the same.

        Raises
        ------
        ProblemError
            If the step does not exist or is the first.
        """
        within(step, 1, self.horizon, "steps")
        if step == self.horizon:
            return self
        return self.replace(
            name=f"{self.name}-steps{step}",
            horizon=step,
            actors=tuple(
                actor.replace(
                    poses=actor.poses[: step + 1],
                    importance=None if actor.importance is None else actor.importance[: step + 1],
                )
                for actor in self.actors
            ),
        )

    def without_rules(self) -> "Problem":
        """Returns the problem without inter-robot collision rules; itself if it has none.

        It is the same object each time, so all results computed for it are reused.
        """
        return self if self.rules.none else self._without_rules

    @cached_property
    def _without_rules(self) -> "Problem":
        return self.replace(rules=NO_RULES)

    def of_take(self, k: int) -> "Problem":
        """Returns the problem of a single take, with only its people.

        J of a plan is the mean of its J in all takes, weighted by their probabilities. It is the
        same object each time; without takes, take 0 is the problem itself.

        Raises
        ------
        ProblemError
            If the take does not exist.
        """
        within(k, 0, max(len(self.takes), 1) - 1, "take")
        if not self.takes:
            return self
        if k not in self._alone:
            inside = np.flatnonzero(self.take_of == k).tolist()
            self._alone[k] = self.replace(
                actors=tuple(self.actors[j].replace(take=None) for j in inside),
                objective=of_people(self.objective, len(self.actors), inside),
                takes=(),
                name=f"{self.name}, {told_take(self.takes[k].name)}",
            )
        return self._alone[k]

    @cached_property
    def _alone(self) -> "dict[int, Problem]":
        return {}

    @cached_property
    def step_weights(self) -> FloatArray:
        """Weights of all faces at all steps [T+1, F]: the face's times its actor's importance."""
        weights = self.importance[:, self.face_owner] * self.face_weights
        if self.objective.pixels != 1:
            weights = weights * self.objective.pixels
        return read_only(weights)

    @cached_property
    def count_weights(self) -> FloatArray:
        """Weights of a drone that sees a person [T+1, A]; [T+1, 0] if such drones are not
        counted.
        """
        if self.objective.views is None:
            return np.zeros((self.horizon + 1, 0))
        weights = self.importance * np.array(self.objective.views.weights(len(self.actors)))
        return read_only(weights)

    @cached_property
    def importance(self) -> FloatArray:
        """Importance of all people at all steps [T+1, A], times the probability of their take."""
        steps = self.horizon + 1
        rows = [
            (1.0,) * steps if a.importance is None else a.importance[:steps] for a in self.actors
        ]
        importance = np.array(rows).reshape(len(self.actors), steps).T
        return read_only(importance * self.chances if self.takes else importance)

    @cached_property
    def face_weights(self) -> FloatArray:
        """Weights of all faces [F], actors in order, before the actors' importance."""
        weights = [actor.face_weights for actor in self.actors]
        return read_only(np.concatenate(weights or [np.empty(0)]))

    @cached_property
    def face_owner(self) -> IntArray:
        """Index of the actor that each face belongs to [F]."""
        counts = [len(actor.face_weights) for actor in self.actors]
        owner = np.repeat(np.arange(len(counts)), counts)
        owner.setflags(write=False)
        return owner

    @property
    def view_sum_steps(self) -> int:
        """Number of steps with separate pixels: T+1, or 1 if pixels add up over time.

        A view sum is a face at such a step, with number step * F + face; J adds up the roots of
        view sums. If drones that see people are counted, a person at a step is a view sum, too,
        after all faces, with number n_roots + step * A + person.
        """
        return 1 if self.objective.over_time else self.horizon + 1

    @cached_property
    def returns(self) -> Returns:
        """The returns of all view sums: roots of pixels, and counts of drones."""
        counts = self.count_weights.size
        cameras = 0 if self.objective.views is None else self.objective.views.cameras
        n_roots = self.view_sum_steps * len(self.face_weights)
        return Returns(n_roots, read_only(np.full(counts, float(cameras))))

    @property
    def step_width(self) -> int:
        """Number of view sums to which a state adds, W: F faces, plus A people if views are
        counted.
        """
        return len(self.face_weights) + int(self.count_weights.shape[1])

    @cached_property
    def step_view_sums(self) -> IntArray:
        """The view sums to which states add [T+1, W]: of all faces, then of the counted people."""
        steps, faces = np.arange(self.horizon + 1)[:, None], len(self.face_weights)
        people = self.count_weights.shape[1]
        first = 0 * steps if self.objective.over_time else steps * faces
        counts = self.returns.n_roots + steps * people + np.arange(people)
        found = np.concatenate([first + np.arange(faces), counts], axis=1)
        found.setflags(write=False)
        return found

    def view_sums_at(self, t: int) -> slice | IntArray:
        """Returns the view sums [W] to which states at step t add: faces, then counted people."""
        if self.objective.views is not None:
            return np.asarray(self.step_view_sums[t])
        faces = len(self.face_weights)
        first = 0 if self.objective.over_time else t * faces
        return slice(first, first + faces)

    def by_step(self, values: FloatArray) -> FloatArray:
        """Returns the sums [T+1] of values [Z] over each step's view sums; not available with
        `over_time`.
        """
        steps, n = self.horizon + 1, self.returns.n_roots
        sums: FloatArray = values[:n].reshape(steps, len(self.face_weights)).sum(axis=1)
        if len(values) > n:
            sums = sums + values[n:].reshape(steps, -1).sum(axis=1)
        return sums

    def no_pixels(self) -> FloatArray:
        """Returns view sums [Z] to which no robot has added anything yet."""
        return np.zeros(self.returns.n_roots + len(self.returns.caps))

    @cached_property
    def view_sum_weights(self) -> FloatArray:
        """Weight w of every view sum [Z]; 0 for steps that do not count."""
        counts = np.arange(self.horizon + 1) >= self.first_step
        faces = (counts[:, None] * self.step_weights).ravel()
        if self.objective.over_time:  # pixels of steps that do not count are not added
            faces = self.step_weights[0]
        if self.objective.views is None:
            return read_only(faces)
        return read_only(np.concatenate([faces, (counts[:, None] * self.count_weights).ravel()]))

    @property
    def most_views_of_a_face(self) -> int:
        """Largest number of views (of one robot at one step) that add to a face's view sum."""
        return len(self.robots) * (self.horizon + 1 if self.objective.over_time else 1)

    @property
    def first_step(self) -> int:
        """First step whose views count, 0 or 1."""
        return 0 if self.objective.count_start else 1
