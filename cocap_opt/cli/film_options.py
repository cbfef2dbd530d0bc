"""Options of films, and the film that `show` writes."""

import re
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from cocap_opt.console.progress import Watch
from cocap_opt.player.filming import MOVING, VIEWS, Filming
from cocap_opt.run.options import Option, UsageError
from cocap_opt.stop import TimeLimit

if TYPE_CHECKING:
    from cocap_opt.player.player import Player

_VIDEO_SIZE, _MOVING_SIZE = (1280, 720), (800, 450)  # px
_LEAST, _MOST = 200, 3840  # px
_SPEEDS = 0.1, 60.0
_SECONDS = 600.0  # largest time in s for making a film


@Parameter(name="*")
@dataclass(frozen=True)
class FilmOptions:
    """The options that define how a film shows plans."""

    view: Annotated[
        str | None,
        Parameter(help="view of a film: 3d or above (default: 3d; GIF: a drawing from above)"),
    ] = None
    size: Annotated[
        str | None,
        Parameter(help="size of a film, px (default: 1280x720; WebP and GIF 800x450)"),
    ] = None
    speed: Annotated[
        float | None,
        Parameter(help="speed of a film, steps per second (default: 2; 4 for more than 24 steps)"),
    ] = None
    time_limit: Annotated[
        float | None,
        Parameter(
            help="seconds in which the film must be finished, or none is written; inf: no limit "
            "(default: 600)"
        ),
    ] = None

    @property
    def given(self) -> list[str]:
        """The options about films that were given, as users write them."""
        values = asdict(self).items()
        return [f"--{name.replace('_', '-')}" for name, value in values if value is not None]

    def filming(self, suffix: str) -> Filming:
        """Returns the settings of the requested film.

        Raises
        ------
        UsageError
            If an option has a value that is not allowed, or a film cannot be made here.
        """
        view = self.view or VIEWS[0]
        Option("--view").require_one_of(view, VIEWS)
        if self.speed is not None and not _SPEEDS[0] <= self.speed <= _SPEEDS[1]:
            raise UsageError(
                f"--speed: must be {_SPEEDS[0]:g}..{_SPEEDS[1]:g} steps a second, not {self.speed}"
            )
        from cocap_opt.player.film import FilmError, require_film  # takes long to import

        try:
            require_film(suffix)
        except FilmError as error:
            raise UsageError(f"-o: {error}") from error
        return Filming(suffix, view, self._pixels(suffix), self.speed)

    def _pixels(self, suffix: str) -> tuple[int, int]:
        if self.size is None:
            return _MOVING_SIZE if suffix in MOVING else _VIDEO_SIZE
        found = re.fullmatch(r"(\d{1,4})x(\d{1,4})", self.size)
        width, height = (int(found[1]), int(found[2])) if found else (0, 0)
        if not all(_LEAST <= long <= _MOST and long % 2 == 0 for long in (width, height)):
            raise UsageError(
                f"--size: must be two even numbers {_LEAST}..{_MOST} such as 1280x720, "
                f"not {self.size!r}"
            )
        return width, height

    def film(
        self, seed: int, player: "Player", filming: Filming
    ) -> tuple[bytes, dict[str, object]]:
        """Returns a film, and its entries in the answer."""
        from cocap_opt.player.film import FilmError, filmed_plans

        seconds = _SECONDS if self.time_limit is None else self.time_limit
        stop = TimeLimit(Option("--time-limit").require_limit(seconds))
        with Watch.on_terminal(f"{player.scene} seed {seed}") as watch:
            try:
                content, count = filmed_plans(player, filming, stop, watch.countdown("pictures"))
            except FilmError as error:
                raise UsageError(f"-o: {error}") from error
        size = "x".join(map(str, filming.size))
        return content, {"pictures": count, "per_second": filming.rate, "size": size}
