"""The commands that show plans: a player, pictures from above, and the drones' images."""

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from cocap_opt.cli.film_options import FilmOptions
from cocap_opt.cli.options import (
    Json,
    Output,
    PlanPath,
    Scene,
    Seed,
    Whole,
    load,
    load_planned,
    plan_with_scene,
    say_doubts,
    say_narrow_way,
    say_strains,
)
from cocap_opt.console.progress import Watch
from cocap_opt.data import LARGEST, MOST_PIXELS
from cocap_opt.files.documents import FileError, problem_digest, read_bytes
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.formulations.explanation import Explanation
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import (
    GivenPlan,
    PlanReader,
    check_output,
    make_folder,
    save_bytes,
)
from cocap_opt.player.filming import FILMS
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import UnsupportedError
from cocap_opt.run.options import Option, UsageError
from cocap_opt.scenarios import Site, load_site
from cocap_opt.text import counted, plain

if TYPE_CHECKING:
    from cocap_opt.player.player import Player
    from cocap_opt.player.player_proof import Proof

_log = logging.getLogger(__name__)

_SHOWN = Path("show.html")
_MOST_STEPS = 100  # steps in one picture
SHOWN = (".html", ".png", ".pdf", ".svg", ".gif", ".webm", ".mp4", ".webp")
_AS_USUAL = FilmOptions()


def _show(
    scene: Scene,
    /,
    *plan: PlanPath,
    output: Output = None,
    seed: Seed = 0,
    certificate: Annotated[
        Path | None,
        Parameter(
            help="certificate or proof; the player then shows the bound, what it proves about each "
            "plan, and the cost of each move"
        ),
    ] = None,
    steps: Annotated[
        str | None,
        Parameter(help="steps to draw, e.g. 5 or 0,4,8 (default: last step; GIF: all)"),
    ] = None,
    film: FilmOptions = _AS_USUAL,
    heights: Annotated[
        str | None,
        Parameter(
            help="flight heights in m, e.g. 4,6, at which to draw where a recipe's drones may "
            "start; only without a plan"
        ),
    ] = None,
    json: Json = False,
) -> int:
    """Play plans side by side in an HTML file, film them, or draw one from above.

    The HTML file needs no network and no other file. A film (WebM, MP4, WebP; GIF with --view)
    shows what the HTML file plays, and needs Chromium. PNG, PDF and SVG files show one step, or
    several side by side; a GIF file shows them one after the other. Without a plan you see the map,
    the people and the drones at their starts; if starts are to be chosen, or a recipe has no drones
    or invalid starts, you see where drones may start. Without -o the file is show.html. A solution
    of Hughes et al. names its scene, so you need not pass one.

    Example: cocap-opt show corridor greedy.json cocap.json -o plans.html
    """
    plan = plan or plan_with_scene(scene)
    output, suffix = Option("-o").file(output or _SHOWN, SHOWN)
    is_film = suffix in FILMS and (suffix != ".gif" or bool(film.given))
    _require_shown(plan, suffix, is_film)
    if film.given and not is_film:
        raise UsageError(
            f"{', '.join(film.given)}: must be left out for {suffix}, as it is not a film"
        )
    if certificate and not (plan and (suffix == ".html" or is_film)):
        raise UsageError("--certificate: needs a plan, and a film or a file that ends in .html")
    if steps is not None and (suffix == ".html" or is_film or not plan):
        raise UsageError(
            "--steps: requires a plan, and a picture: players and films show all steps"
        )
    if heights is not None and plan:
        raise UsageError("--heights: applies to a recipe without a plan, to place its drones")
    check_output(output, scene, *plan, certificate)
    filming = film.filming(suffix) if is_film else None
    site = None if plan else load_site(scene, Option("--seed").require_whole(seed))
    if heights is not None and site is None:
        raise UsageError("--heights: requires a recipe, a file that ends in .toml")
    if site is not None and (site.problem is None or heights is not None):
        return _show_site(scene, seed, site, output, _heights(heights), json)
    problem = _loaded(scene, seed, site) if not plan else load_planned(scene, seed)
    given = PlanReader(scene, problem).plans(plan, any_objective=True)
    loaded, problem = problem, given[0].problem if given else problem
    plans = [given_plan.plan for given_plan in given]
    if not plan:
        say_strains(scene, seed, problem)
    say_narrow_way(scene, seed, problem)
    answer: dict[str, object] = {"scene": problem.name, "seed": seed}
    if filming or suffix == ".html":
        gaps, proof = list[Explanation](), None
        if certificate:
            gaps = _gaps(problem, plans, certificate)
            proof = _proof(certificate, scene, seed, loaded, plan, given)
        player = _player(problem, given, plan, gaps, proof)
        if filming:
            content, told = film.film(seed, player, filming)
            answer |= told
        else:
            content = player.page().encode()
    else:
        chosen = () if steps is None else _steps(problem, steps)
        content = _picture(problem, plans, suffix, chosen)
    save_bytes(output, content)
    answer |= {"digest": problem_digest(problem), "file": output}
    print_result(answer, json)
    return 0


def _require_shown(plans: Sequence[Path], suffix: str, is_film: bool) -> None:
    """Raises a UsageError if a file with this ending cannot show so many plans."""
    if not plans and (is_film or suffix == ".gif"):
        raise UsageError("PLAN: name a plan, such as plan.json; without a plan nothing moves")
    if suffix != ".html" and not is_film and len(plans) > 1:
        raise UsageError(
            f"PLAN: a {suffix} file shows one plan, not {len(plans)}; .html takes more"
        )


def _loaded(scene: str, seed: int, site: Site | None) -> Problem:
    """Returns a scene, the one in a recipe's site if it has one, and logs doubtful entries."""
    if site is None or site.problem is None:
        return load(scene, seed)
    say_doubts(scene, seed, site.problem)
    return site.problem


def _show_site(
    scene: str, seed: int, site: Site, output: Path, heights: Sequence[float], json: bool
) -> int:
    """Draws where the drones of a recipe may start, and reports why it is not a scene yet."""
    from cocap_opt.pictures.start_map import start_picture

    say_doubts(scene, seed, site.problem or site.scene)
    for words in site.words:
        _log.warning("%s, seed %d: %s", scene, seed, words)
    if output.suffix == ".html":
        from cocap_opt.player.start_page import start_page

        content = start_page(site, heights).encode()
    else:
        content = start_picture(site, output.suffix, heights)
    save_bytes(output, content)
    refused = len(site.refusals) + len(site.notes)
    drones = len(site.scene.robots)
    answer = {"scene": site.scene.name, "seed": seed}
    if json:
        print_result({**answer, "drones": drones, "refused": refused, "file": output}, json)
    else:
        rejected = f"; {refused} rejected, see above" if refused else ""
        words = f"{counted(drones, 'drone')}{rejected}"
        print_result({**answer, "file": output, "message": words}, json)
    return 0


def _heights(text: str | None) -> tuple[float, ...]:
    """Returns the distinct flight heights (m) of a list, lowest first."""
    try:
        found = () if text is None else tuple(sorted({float(part) for part in text.split(",")}))
    except ValueError:
        raise UsageError(f"--heights: must be numbers such as 4,6, not {text!r}") from None
    if not all(abs(height) <= LARGEST for height in found):
        raise UsageError(f"--heights: must be within +-{plain(LARGEST)} m, not {text!r}")
    return found


def _render(
    scene: Scene,
    plan: PlanPath,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"], help="folder to write to")],
    seed: Seed = 0,
    width: Annotated[Whole, Parameter(help="width of the images, px")] = 800,
    pixel_step: Annotated[
        Whole, Parameter(help="N: count one pixel per block of N x N pixels; 1 is exact")
    ] = 1,
    json: Json = False,
) -> int:
    """Render the view of each drone, and compare planned coverage with the rendered pixels.

    The command writes a PNG image for each drone and step (and take, if the scene has takes), and
    coverage.csv with a row for each face in an image.

    Example: cocap-opt render corridor plan.json -o views
    """
    from cocap_opt.pictures.rendering import write_views  # matplotlib takes long to import

    if output is None:
        raise UsageError("-o: name the folder to write to")
    for option, value, most in (("--width", width, MOST_PIXELS), ("--pixel-step", pixel_step, 100)):
        if not 1 <= value <= most:
            raise UsageError(f"{option}: must be 1..{most}, not {value}")
    problem, shown, _ = PlanReader(scene, load_planned(scene, seed)).plan(plan)
    make_folder(output)
    with Watch.on_terminal(f"{problem.name} seed {seed}") as watch:
        try:
            row = write_views(output, problem, shown, width, pixel_step, watch.counter)
        except UnsupportedError as error:
            raise UsageError(f"{scene}: {error}") from error
    print_result({"scene": problem.name, "seed": seed, "folder": output} | row, json)
    return 0


def _gaps(problem: Problem, plans: Sequence[Plan], path: Path) -> list[Explanation]:
    """Returns the terms of each plan's gap, from a certificate or a proof in a file."""
    from cocap_opt.run.explained import gaps_of

    file = PlanReader(problem.name, problem).claim(path)
    if not isinstance(file, CertificateFile | ProofFile):
        raise FileError(f"{path}: must be a certificate or a proof, not a plan")
    try:
        return gaps_of(problem, plans, file)
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error


def _proof(
    path: Path, scene: str, seed: int, loaded: Problem, plans: Sequence[Path],
    given: Sequence[GivenPlan],
) -> "Proof":  # fmt: skip
    """Returns a certificate or a proof as the player offers it."""
    from cocap_opt.player.player_proof import Proof

    return Proof.of(path, read_bytes(path), scene, seed, loaded, plans, given)


def _steps(problem: Problem, text: str) -> tuple[int, ...]:
    """Returns the steps of a list; all must be in the scene."""
    found = Option("--steps").numbers(text)
    if max(found) > problem.horizon:
        raise UsageError(f"--steps: must be 0..{problem.horizon}, not {max(found)}")
    if len(found) > _MOST_STEPS:
        raise UsageError(f"--steps: must be at most {_MOST_STEPS} steps, not {len(found)}")
    return found


def _player(
    problem: Problem,
    given: Sequence[GivenPlan],
    paths: Sequence[Path],
    gaps: Sequence[Explanation],
    proof: "Proof | None",
) -> "Player":
    """Returns the player of plans from files."""
    from cocap_opt.player.player import Player

    titles = PlanReader.titles(paths)
    titled = [(title, given_plan.plan) for title, given_plan in zip(titles, given, strict=True)]
    planners = [given_plan.planner for given_plan in given]
    cut_short = [given_plan.cut_short for given_plan in given]
    return Player(problem, titled, gaps, planners, cut_short, proof)


def _picture(problem: Problem, plans: Sequence[Plan], suffix: str, steps: Sequence[int]) -> bytes:
    """Returns a picture of the only plan, or of the starts."""
    from cocap_opt.pictures.figures import plan_picture  # matplotlib takes long to import

    return plan_picture(problem, plans[0] if plans else None, suffix, steps)


COMMANDS = {"show": _show, "render": _render}
