import hashlib
import json
import re
import shutil
import subprocess
from base64 import b64decode
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from pathlib import Path
from threading import Thread
from typing import Any
from urllib.parse import unquote, urlparse

import numpy as np
import pytest
from browser import value
from msgspec.structs import replace
from PIL import Image
from players import EVIL, ROOT, crossing, hills, planned, run, seen_by, shut_in, told
from players import plans as plans
from scipy.interpolate import BPoly
from strategies import tiny

from cocap_opt.experiments.lab.studies.pictures import Browser
from cocap_opt.files.documents import PlanFile, SceneFile, problem_digest
from cocap_opt.player import player_scene
from cocap_opt.player.player import Player
from cocap_opt.player.scripts import bundled
from cocap_opt.problem import Airspace, CollisionRules, Plan, Problem, State, TriangulatedCuboid
from cocap_opt.referee import check
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit
from cocap_opt.vision.render import Renderer

# -- browser ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def player(plans: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A browser with two plans of the bottleneck."""
    if not Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    page = tmp_path_factory.mktemp("page") / "plans.html"
    files = plans / "greedy.json", plans / "cocap.json"
    assert run("show", "bottleneck", *files, "-o", page) == 0
    with Browser.opened(page) as driver:
        yield driver


def step_of(player: Any) -> int:
    """Step that the page says it shows."""
    return int(value(player, "document.getElementById('step').textContent").split()[1])


def wait_until(player: Any, expression: str) -> None:
    """Wait until an expression holds in the page."""
    from selenium.webdriver.support.wait import WebDriverWait

    WebDriverWait(player, 20, poll_frequency=0.05).until(lambda page: value(page, expression))


# Share of the samples of a panel's picture that are not the white of the paper.
INKED = """(() => {
  const c = document.querySelectorAll('canvas.%s')[%d];
  const copy = new OffscreenCanvas(c.width, c.height).getContext('2d', {willReadFrequently: true});
  copy.drawImage(c, 0, 0);
  const d = copy.getImageData(0, 0, c.width, c.height).data;
  let n = 0;
  for (let i = 0; i < d.length; i += 4) if (d[i + 3] && d[i] + d[i + 1] + d[i + 2] < 750) n++;
  return n / (d.length / 4);
})()"""


class Quiet(SimpleHTTPRequestHandler):
    """Serves files without a word."""

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@pytest.fixture
def served(tmp_path: Path) -> Iterator[str]:
    """Address of a folder of this test, which a server on this machine has."""
    handler = partial(Quiet, directory=str(tmp_path))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


@pytest.mark.slow
def test_the_script_is_its_modules(player: Any, served: str, tmp_path: Path) -> None:
    """A page that loads them as modules, as browsers do, shows the same."""
    player.go_to(6)
    shown, before = value(player, PICTURES), player.current_url
    folder = ROOT / "cocap_opt" / "player" / "page"
    for script in folder.glob("*.js"):
        shutil.copy(script, tmp_path)
    page = Path(unquote(urlparse(before).path)).read_text("utf-8")
    page, count = re.subn(r"<script>.*</script>", '<script type="module" src="player.js"></script>',
                          page.replace("default-src 'none'; script-src", "script-src 'self'"),
                          flags=re.DOTALL)  # fmt: skip
    assert count == 1 and "Camera" not in page
    (tmp_path / "plans.html").write_text(page, "utf-8")
    player.get(f"{served}/plans.html")
    wait_until(player, "document.documentElement.dataset.ready === 'yes'")
    player.go_to(6)
    assert value(player, PICTURES) == shown
    assert player.get_log("browser") == []
    player.get(before)


# All pictures of the page.
PICTURES = "[...document.querySelectorAll('canvas')].map((canvas) => canvas.toDataURL())"


@pytest.mark.slow
def test_two_plans_stand_side_by_side(player: Any) -> None:
    """Each has a panel with its name, a picture and a chart, at one height."""
    player.go_to(3)
    for what, names in (("h2", ["greedy", "cocap"]), (".file", ["greedy.json", "cocap.json"])):
        named = f"[...document.querySelectorAll('.panel {what}')].map((e) => e.textContent)"
        assert value(player, named) == names
    places = "[...document.querySelectorAll('.panel')].map((p) => [p.offsetLeft, p.offsetTop])"
    boxes = value(player, places)
    assert boxes[0][1] == boxes[1][1] and boxes[0][0] + 300 < boxes[1][0]
    for panel in range(2):
        assert value(player, INKED % ("view", panel)) > 0.2
        assert value(player, INKED % ("chart", panel)) > 0.05


def scripts(**names: str) -> str:
    """Modules of the page, of which these names are taken (`rays="Rays"`)."""
    taken = [f"const {{ {some} }} = ${module};" for module, some in names.items()]
    return "\n".join((bundled(*names), *taken, ""))


# Where the camera puts all people and drones at first, as shares of a picture so wide and high.
FRAMED = """
const [data, width, height] = arguments, blocks = new Blocks(data);
const camera = new Camera(data, new Rays(data, blocks));
camera.fit(width, height);
camera.update();
const people = data.people.flatMap(({ poses, height: tall }) =>
  poses.flatMap(([x, y, z]) => [[x, y, z], [x, y, z + tall]]));
const drones = data.plans.flatMap(({ paths }) => paths.flat()).map(([x, y, z]) => [x, y, z]);
return [...people, ...drones].map((point) => {
  const way = minus(point, camera.centre);
  const size = camera.focal / (camera.away + dot(way, camera.ahead));
  const along = size * dot(way, camera.right), up = size * dot(way, camera.up);
  return [0.5 + along / width, 0.5 - up / height];
});
"""


@pytest.mark.slow
def test_pictures_of_two_plans_are_alike(player: Any) -> None:
    """Their sizes, and where they and the charts begin, are the same whatever words are beside."""
    for step in (0, 1, 5):
        player.go_to(step)
        for name in ("canvas.view", ".strip", ".chart"):
            found = f"[...document.querySelectorAll('{name}')]"
            sizes = f"{found}.map((e) => [e.getBoundingClientRect().top, e.offsetHeight])"
            one, other = value(player, sizes)
            assert one == other


@pytest.mark.slow
def test_people_and_drones_fill_the_opening_picture(player: Any) -> None:
    """All of them are in it at all steps, and reach its margins along one axis, in any shape."""
    data = told(player.page_source)
    script = scripts(geometry="dot, minus", blocks="Blocks", rays="Rays", camera="Camera") + FRAMED
    for wide, tall in ((1400, 500), (600, 600), (370, 700)):
        places = np.array(player.execute_script(script, data, wide, tall))
        assert (places > 0).all() and (places < 1).all()
        assert max(np.ptp(places, axis=0) / (1 - 68 / wide, 1 - 86 / tall)) == pytest.approx(
            1, abs=0.02
        )


@pytest.mark.slow
def test_drones_fly_smoothly_from_step_to_step(player: Any) -> None:
    """On the polynomials of the page's rows; tracks bend with them, and meet the steps."""
    problem = load_scene("bottleneck", 0)
    ((_, plan),) = planned(problem, "cocap")
    (told_plan,) = Player(problem, [("", plan)]).data()["plans"]
    fly = (
        scripts(flights="Flight")
        + """const [plan, times] = arguments;
        const flights = plan.paths.map((_, i) => new Flight(plan, i));
        const wayOf = (flight, step) => flight.way(step).map((pose) => pose.slice(0, 3));
        return flights.map((flight) => [times.map((time) => flight.at(time)),
          plan.paths[0].slice(1).map((_, step) => wayOf(flight, step))])
        """
    )
    times = np.linspace(0, problem.horizon, 7 * problem.horizon + 1)
    found = player.execute_script(fly, told_plan, times.tolist())
    for rows, path, (poses, ways) in zip(
        told_plan["knots"], told_plan["paths"], found, strict=True
    ):
        table = np.array(rows)
        smooth = BPoly.from_derivatives(table[:, 0], table[:, 1:].reshape(-1, 3, 5))
        np.testing.assert_allclose(poses, smooth(times), atol=1e-6)
        for step, way in enumerate(ways):
            assert way[0] == path[step][:3] and way[-1] == path[step + 1][:3]
            along = smooth(np.linspace(step, step + 1, 61))[:, :3]
            apart = np.linalg.norm(along[:, None] - np.array(way), axis=2)
            assert len(way) == 2 or apart.min(axis=0).max() < 1e-6
    assert max(len(way) for _, ways in found for way in ways) > 2
    straight = told_plan | {"knots": None}
    for (poses, _), path in zip(
        player.execute_script(fly, straight, [0.5]), told_plan["paths"], strict=True
    ):
        np.testing.assert_allclose(poses[0][:3], np.mean(path[:2], axis=0)[:3], atol=1e-9)


# Numbers of blocks of a scene, where they are cut off, and which of them rays meet.
BLOCKS = """
const [scene, rays] = arguments, blocks = new Blocks(scene), all = new Rays(scene, blocks);
const met = rays.map(([from, way, most]) => {
  const marked = new Uint8Array(blocks.count);
  all.mark(from, way, most, marked);
  return [...marked];
});
const numbers = [[...blocks.ofCell], ...blocks.ofTriangle, blocks.ofBox];
const cuts = [...blocks.cuts].map((cut) => (cut === -Infinity ? null : cut));
return [blocks.count, numbers, cuts, met];
"""


@pytest.mark.slow
def test_what_stands_before_the_action_is_cut_off_as_a_whole(player: Any) -> None:
    """Neighbouring cells with one roof are a block, and so are triangles and boxes that touch.

    A block is cut off above its ground; nothing is left of one that hangs.
    """
    scene = {
        "terrain": {"cell": 1, "cells": [6, 1], "grounds": [0, 0, 1, 0, 0, 0],
                    "heights": [0, 5, 5.5, 9, 0, 0]},
        # Two triangles with one edge, whose corners are repeated, and one apart from them.
        "meshes": [{"vertices": [4, 0, 6, 5, 0, 6, 4, 1, 6, 5, 0, 6, 5, 1, 6, 4, 1, 6,
                                 5.2, 0, 0, 5.8, 0, 0, 5.8, 0, 3],
                    "triangles": [0, 1, 2, 3, 4, 5, 6, 7, 8]}],
        "boxes": [[0, 0, 2, 3], [0, 0, 3, 4], [0, 0, 6, 7]],
    }  # fmt: skip
    rays = [
        ((0.5, 0.5, 0.5), (1, 0, 0), 2),
        ((0.5, 0.5, 0.5), (1, 0, 0), 0.4),
        ((0.5, 0.5, 8), (1, 0, 0), 9),
        ((4.2, 0.2, 1), (0, 0, 1), 9),
        ((0.5, 0.5, 1), (0, 0, 1), 4),
    ]
    script = scripts(blocks="Blocks", rays="Rays")
    count, numbers, cuts, met = player.execute_script(script + BLOCKS, scene, rays)
    assert count == 6
    assert numbers == [[-1, 0, 0, 1, -1, -1], [2, 2, 3], [4, 4, 5]]
    assert cuts == [1.4, 0.4, None, 0.4, None, None]
    assert met == [
        [1, 0, 0, 0, 0, 0],
        [0] * 6,
        [0, 1, 0, 0, 0, 0],
        [0, 0, 1, 0, 0, 0],
        [0, 0, 0, 0, 1, 0],
    ]


# Whether a line of a cut block is outlined; this picture of 10 x 10 px shows y - z downwards.
OUTLINED = """
const [line, cut] = arguments, view = { corners: [], raster: { width: 10, height: 10 } };
view.take = (array, at, k, top) => {
  [view.corners[0], view.corners[1]] = [array[at], array[at + 1] - Math.min(array[at + 2], top)];
  return true;
};
return View.prototype.hasFoot.call(view, line, 0, cut ?? -Infinity);
"""


@pytest.mark.slow
def test_outlines_stand_on_feet_that_are_seen(player: Any) -> None:
    """A roof whose foot is outside the picture has none: nobody could tell what it belongs to."""
    script = scripts(view="View") + OUTLINED
    for line, cut, is_shown in (
        ([5, 5, 0, 5, 5, 20], 0.4, True),
        ([5, 5, 20, 12, 5, 20], 0.4, True),  # one end is enough
        ([5, 25, 20, 6, 25, 20], 0.4, False),
        ([5, 25, 20, 6, 25, 20], None, True),  # a block that hangs has no foot
    ):
        assert player.execute_script(script, line, cut) == is_shown


@pytest.mark.slow
def test_the_slider_sets_the_step(player: Any, plans: Path) -> None:
    """The reward shown is the referee's for that step, and so are the conflicts."""
    problem = load_scene("bottleneck", 0)
    verdicts = [
        check(problem, PlanFile.read(plans / f"{n}.json").plan) for n in ("greedy", "cocap")
    ]
    for step in (1, 6, problem.horizon):
        player.go_to(step)
        assert step_of(player) == step
        shown = value(player, "[...document.querySelectorAll('.now')].map((e) => e.dataset.value)")
        assert list(map(float, shown)) == [v.reward_per_step[step - 1] for v in verdicts]
        red = "[...document.querySelectorAll('.words')].map((e) => e.matches(':not(.mild)'))"
        said = value(player, red)
        for verdict, words in zip(verdicts, said, strict=True):
            assert any(c.startswith(f"step {step}:") for c in verdict.conflicts) == words


@pytest.mark.slow
def test_pages_open_in_real_time(player: Any, tmp_path: Path) -> None:
    """Where it is known how long a step lasts; else at two steps a second."""
    page, before, problem = tmp_path / "page.html", player.current_url, load_scene("tiny-queue")
    texts = (
        "[...document.getElementById('speed').children].map((o) => "
        "(o.children.length ? `${o.label}: ` : '') + o.textContent).join(' ')"
    )
    for seconds, speed, speeds in (
        (None, "2", "0.5 1 2 4 8 16"),
        (4.0, "0.25", "real time: 0.25 0.5 1 2 4 8 16"),
        (1.0, "1", "0.5 real time: 1 2 4 8 16"),
        (0.04, "25", "0.5 1 2 4 8 16 real time: 25"),
    ):
        Player(problem.replace(step=seconds)).save(page)
        player.get(page.as_uri())
        assert value(player, texts) == speeds
        assert value(player, "document.getElementById('speed').value") == speed
    player.get(before)


@pytest.mark.slow
def test_play_advances_and_stops_at_the_end(player: Any) -> None:
    """The button plays, the space key pauses; at the end it stops, and begins anew if asked."""
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    def at_speed(speed: str) -> None:
        player.execute_script(
            "const s = document.getElementById('speed'); s.value = arguments[0];"
            "s.dispatchEvent(new Event('change'))",
            speed,
        )

    player.go_to(0)
    button = player.find_element(By.ID, "play")
    at_speed("1")
    button.click()
    wait_until(player, "Number(document.getElementById('slider').value) >= 2")
    player.find_element(By.TAG_NAME, "body").send_keys(Keys.SPACE)
    assert button.get_attribute("aria-label") == "play"
    stopped = step_of(player)
    assert 2 <= stopped < 11
    at_speed("16")
    button.click()
    wait_until(player, "document.getElementById('play').getAttribute('aria-label') === 'play'")
    assert step_of(player) == 11
    button.click()
    wait_until(player, "Number(document.getElementById('slider').value) < 11")
    player.go_to(0)


@pytest.mark.slow
def test_keys_and_chart_lead_to_steps(player: Any) -> None:
    """Left, right, Home, End, C for the next conflict, and a press on a bar of the chart."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    player.go_to(4)
    body = player.find_element(By.TAG_NAME, "body")
    for key, step in ((Keys.RIGHT, 5), (Keys.LEFT, 4), (Keys.END, 11), (Keys.HOME, 0), ("c", 1)):
        body.send_keys(key)
        wait_until(
            player, f"document.getElementById('step').textContent.startsWith('step {step} ')"
        )
    chart = player.find_elements(By.CLASS_NAME, "chart")[1]
    ActionChains(player).move_to_element(chart).click().perform()
    wait_until(player, "!document.getElementById('step').textContent.startsWith('step 1 ')")
    assert step_of(player) in (5, 6)


@pytest.mark.slow
def test_a_focused_element_has_its_own_keys(player: Any) -> None:
    """Space works a focused check box or button and plays from the slider, which has arrows."""
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    before = step_of(player)
    solid, top, space, play, slider = (
        player.find_element(By.ID, name) for name in ("solid", "top", "space", "play", "slider")
    )
    for expected in (True, False):
        solid.send_keys(Keys.SPACE)
        assert solid.is_selected() is expected
    for element, pressed in ((top, ["true", "false"]), (space, ["false", "true"])):
        element.send_keys(Keys.SPACE)
        assert [e.get_attribute("aria-pressed") for e in (top, space)] == pressed
    assert play.get_attribute("aria-label") == "play" and step_of(player) == before
    slider.send_keys(Keys.HOME, Keys.RIGHT)
    wait_until(player, "document.getElementById('step').textContent.startsWith('step 1 ')")
    slider.send_keys(Keys.SPACE)
    assert play.get_attribute("aria-label") == "pause"
    slider.send_keys(Keys.SPACE)
    top.send_keys(Keys.END)  # no key of a button
    wait_until(player, "document.getElementById('step').textContent.startsWith('step 11 ')")


@pytest.mark.slow
def test_the_camera_turns_zooms_and_looks_down(player: Any) -> None:
    """A drag, the wheel and the button for the top view change both pictures."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    player.go_to(6)
    view = player.find_elements(By.CLASS_NAME, "view")[0]
    picture = "[...document.querySelectorAll('canvas.view')].map((c) => c.toDataURL())"
    seen = [value(player, picture)]

    def changed() -> None:
        player.go_to(6)
        seen.append(value(player, picture))
        assert all(a != b for a, b in zip(seen[-1], seen[-2], strict=True))

    ActionChains(player).drag_and_drop_by_offset(view, 60, 20).perform()
    changed()
    player.find_element(By.ID, "top").click()
    changed()
    player.execute_script(
        "arguments[0].dispatchEvent(new WheelEvent('wheel', {deltaY: -300, cancelable: true}))",
        view,
    )
    changed()
    player.find_element(By.ID, "space").click()
    changed()
    assert seen[-1] == seen[0]


@pytest.mark.slow
def test_numbers_of_crowded_drones_stay_near_them(player: Any) -> None:
    """They are apart, cover no name, and are left out where there is no room near the drone."""
    script = scripts(labels="freePlace")
    crowd = "const put = []; for (let i = 0; i < 64; i++) {"
    crowd += "const place = freePlace(5, 7, put, []); if (place) put.push(place); }"
    places = player.execute_script(f"{script}; {crowd} return put")
    assert places[0] == [5, 7] and 4 < len(places) < 64
    apart = np.hypot(*(np.array(places)[:, None] - places).transpose(2, 0, 1))
    assert apart[np.triu_indices(len(places), 1)].min() >= 14 and apart[0].max() <= 40
    named = "[{ x: 5, y: 7, wide: 90, high: 13 }]"
    x, y = player.execute_script(f"{script}; return freePlace(5, 7, [], {named})")
    assert abs(x - 5) >= 52.5 or abs(y - 7) >= 14


@pytest.mark.slow
def test_labels_begin_with_the_name(player: Any) -> None:
    """The number and the take stand behind it; what is long is cut at the end of each."""
    script = scripts(labels="labelOf")
    for name, take, label in (
        ("Carla", "as given", "Carla (5, as given)"),
        ("Carla", None, "Carla (5)"),
        (None, "take 1", "5 (take 1)"),
        (None, None, "5"),
        (
            "Maria Magdalena Bernhardine",
            "take two of three",
            "Maria Magdalena B… (5, take two of…)",
        ),
    ):
        person = json.dumps({"name": name, "inTake": take})
        assert player.execute_script(f"{script}; return labelOf({person}, 5)") == label


@pytest.mark.slow
def test_numbers_stay_behind_names_from_right_to_left(player: Any, tmp_path: Path) -> None:
    """A mark ends such a name; other text is as it was. The list and the strip have the marks."""
    script = scripts(letters="inOrder")
    for text, shown in (
        ("Zoë <i> (0), 4 m", "Zoë <i> (0), 4 m"),
        ("\u05d2'\u05d5\u05df (3), 4 m", "\u05d2'\u05d5\u05df\u200e (3), 4 m"),
        ("\u0639\u0644\u064a \u062d (4)", "\u0639\u0644\u064a \u062d\u200e (4)"),
    ):
        assert player.execute_script(f"{script}; return inOrder({json.dumps(text)})") == shown
    problem, page = load_scene("corridor", 0), tmp_path / "page.html"
    named = tuple(actor.replace(name="\u05d2\u05df") for actor in problem.actors)
    problem = problem.replace(actors=named)
    Player(problem, planned(problem, "greedy")).save(page)
    with Browser.opened(page) as browser:
        films = value(browser, "document.querySelector('.films').textContent")
        told = value(browser, "document.querySelector('.told').textContent")
    assert films.startswith("\u05d2\u05df\u200e (") and told.startswith("\u05d2\u05df\u200e (")


# What the hint says at points all over the first picture.
HINTS = """(() => {
  const view = document.querySelector('canvas.view'), tip = document.querySelector('.tip');
  const said = new Set(), { left, top, width, height } = view.getBoundingClientRect();
  for (let x = 2; x < width; x += 5) for (let y = 2; y < height; y += 5) {
    const at = { clientX: left + x, clientY: top + y, pointerId: 1 };
    view.dispatchEvent(new PointerEvent('pointermove', at));
    if (tip.classList.contains('on')) said.add(tip.textContent);
  }
  return [...said];
})()"""


@pytest.mark.slow
def test_a_face_says_how_well_it_is_seen(player: Any) -> None:
    """Under the pointer: whose face it is and its px/m2; of each person some faces are there."""
    player.go_to(6)
    (seen,) = (plan["seen"][6] for plan in told(player.page_source)["plans"][:1])
    said = [re.fullmatch(r"person (\d), (\w+): (.*)", hint) for hint in value(player, HINTS)]
    said = [hint for hint in said if hint]
    assert {hint[1] for hint in said if hint} == {"0", "1", "2", "3"} and len(said) >= 8
    names = ["front", "left", "back", "right", "top"]
    for hint in said:
        assert hint is not None
        pixels = seen[5 * int(hint[1]) + names.index(hint[2])]
        assert hint[3] == (f"{pixels:,.0f} px/m²" if pixels else "not seen")


def press(player: Any, key: str) -> None:
    """Press a key anywhere on the page, and wait until it is drawn."""
    from selenium.webdriver.common.by import By

    player.find_element(By.TAG_NAME, "body").send_keys(key)
    drawn = "const done = arguments[0], next = requestAnimationFrame; next(() => next(done))"
    player.execute_async_script(drawn)


# Colour of the first picture at a share of its width and height, and so many px aside.
COLOUR = """(() => {
  const c = document.querySelector('.chosen canvas.view');
  const at = [Math.round(c.width * %g), Math.round(c.height * %g + %g), 1, 1];
  const copy = new OffscreenCanvas(c.width, c.height).getContext('2d', {willReadFrequently: true});
  copy.drawImage(c, 0, 0);
  return [...copy.getImageData(...at).data].slice(0, 3);
})()"""


@pytest.mark.slow
def test_the_page_opens_at_the_first_step_that_counts(player: Any) -> None:
    """A start that does not count is no picture to begin with."""
    player.refresh()
    wait_until(player, "document.documentElement.dataset.ready === 'yes'")
    assert load_scene("bottleneck", 0).first_step == step_of(player) == 1


@pytest.mark.slow
def test_a_picked_drone_shows_what_it_sees_and_is_followed(player: Any) -> None:
    """By key or by its number: its own picture, what it adds, and itself in the middle."""
    from selenium.webdriver.common.by import By

    player.go_to(4)
    hidden = "[...document.querySelectorAll('.inset')].map((box) => box.hidden)"
    assert value(player, hidden) == [True, True]
    press(player, "d")
    assert value(player, hidden) == [False, False]
    eye = "document.querySelector('.inset canvas').toDataURL()"
    first = value(player, eye)
    player.find_elements(By.CLASS_NAME, "chip")[2].click()
    press(player, "f")
    assert value(player, eye) != first
    colour = player_scene.PlayerScene(load_scene("bottleneck", 0)).drone(2)["colour"]
    (plan, _) = told(player.page_source)["plans"]
    for step in (4, 9):
        player.go_to(step)
        caption = value(player, "document.querySelector('figcaption').textContent")
        assert caption.startswith(f"adds {plan['adds'][2][step]:,.2f} to J ")
        disc = value(player, COLOUR % (0.5, 0.5, -26))
        assert "#{:02x}{:02x}{:02x}".format(*disc) == colour
    press(player, "\ue00c")
    assert value(player, hidden) == [True, True]
    press(player, "0")


@pytest.mark.slow
def test_a_press_on_a_drone_picks_it(player: Any) -> None:
    """One that is picked already is let go; shown alone, the others have no numbers."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    for key in "df":  # drone 0 is picked, and in the middle
        press(player, key)
    player.go_to(3)
    among = value(player, INKED % ("view", 0))
    press(player, "i")
    player.go_to(3)
    assert value(player, INKED % ("view", 0)) != among
    view = player.find_elements(By.CLASS_NAME, "view")[0]
    ActionChains(player).move_to_element_with_offset(view, 0, -18).click().perform()
    pressed = "[...document.querySelectorAll('.chip')].map((c) => c.ariaPressed)"
    wait_until(player, f"{pressed}.every((one) => one === 'false')")
    press(player, "0")


# Samples of the drone's own picture that have a bright colour, which only seen faces have.
COLOURED = """(() => {
  const c = document.querySelector('.inset canvas'), found = [];
  const copy = new OffscreenCanvas(c.width, c.height).getContext('2d', {willReadFrequently: true});
  copy.drawImage(c, 0, 0);
  const d = copy.getImageData(0, 0, c.width, c.height).data;
  for (let i = 0; i < d.length; i += 4) {
    const [most, least] = [Math.max(d[i], d[i + 1], d[i + 2]), Math.min(d[i], d[i + 1], d[i + 2])];
    found.push(most - least > 0.45 * most ? 1 : 0);
  }
  return [c.width, c.height, found];
})()"""


@pytest.mark.slow
def test_a_drones_picture_is_what_the_renderer_sees(player: Any, tmp_path: Path) -> None:
    """Faces are where rays of the drone's camera meet them, and nowhere else."""
    problem = load_scene("bottleneck", 0)
    problem = problem.replace(robots=problem.robots[:1])
    ((title, plan),) = planned(problem, "greedy")
    page, before, step = tmp_path / "page.html", player.current_url, 6
    Player(problem, [(title, plan)]).save(page)
    player.get(page.as_uri())
    press(player, "d")
    player.go_to(step)
    wide, tall, coloured = value(player, COLOURED)
    player.get(before)
    every = problem.robots[0].camera.width // wide
    faces = Renderer(problem, every).picture(problem.robots[0], step, plan.paths[0][step])[0]
    seen = np.append(seen_by(problem, plan)[step] > 0, [False, False])  # no face: terrain or sky
    rows, columns = (np.linspace(0, n - 1, m).round().astype(int)
                     for n, m in zip(faces.shape, (tall, wide), strict=True))  # fmt: skip
    expected = seen[faces[np.ix_(rows, columns)]]
    shown = np.reshape(coloured, (tall, wide)) > 0
    assert expected.mean() > 0.01
    assert (expected & shown).sum() > 0.85 * (expected | shown).sum()


@pytest.mark.slow
def test_view_cones_end_where_something_stands(player: Any) -> None:
    """Rays meet ground, walls, meshes and what fine meshes fill, and go on above them."""
    script = scripts(rays="Rays")
    scene = {
        "terrain": {"cell": 2, "cells": [5, 1], "heights": [0, 0, 0, 5, 0]},
        "meshes": [{"vertices": [4, 0, 3, 4, 2, 3, 4, 1, 9], "triangles": [0, 1, 2]}],
        "boxes": [[1, 0, 7, 8]],
    }
    rays = [((1, 1, 1), (1, 0, 0)), ((1, 1, 4), (1, 0, 0)), ((1, 1, 7.5), (1, 0, 0)),
            ((1, 1, 12), (1, 0, 0)), ((9, 1, 4), (0.6, 0, -0.8)), ((9, 1, 1), (-1, 0, 0)),
            ((7, 1, 9), (0, 0, -1)), ((3, 1, 9), (0, 0, -1))]  # fmt: skip
    cast = f"{script}; const [scene, rays] = arguments, all = new Rays(scene);"
    cast += "return rays.map(([from, way]) => all.length(from, way, 20))"
    met = player.execute_script(cast, scene, rays)
    assert met == pytest.approx([5, 3, 1, 20, 5, 1, 4, 1])


@pytest.mark.slow
def test_marks_on_the_chart_lead_to_their_moments(player: Any) -> None:
    """A press on the first conflict's mark, and the button with their number."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    step = told(player.page_source)["plans"][0]["conflicts"][-1]["step"]
    chart = player.find_elements(By.CLASS_NAME, "chart")[0]
    wide, tall = chart.size["width"], chart.size["height"]
    middle = 46 + (step + 0.5) / 12 * (wide - 56)
    player.go_to(0)
    at = round(middle - wide / 2), round(8 - tall / 2)
    ActionChains(player).move_to_element_with_offset(chart, *at).click().perform()
    wait_until(player, f"document.getElementById('slider').value === '{step}'")
    player.go_to(0)
    player.find_element(By.CSS_SELECTOR, ".next").click()
    wait_until(player, "document.getElementById('slider').value === '1'")


@pytest.mark.slow
def test_people_are_figures_or_the_faces_that_count(player: Any) -> None:
    """A key switches, and changes the picture."""
    player.go_to(2)
    figures = value(player, "document.querySelector('canvas.view').toDataURL()")
    press(player, "b")
    assert value(player, "document.getElementById('faces').checked")
    assert value(player, "document.querySelector('canvas.view').toDataURL()") != figures
    press(player, "b")


@pytest.mark.slow
def test_the_strip_tells_who_is_seen_by_how_many_cameras(player: Any) -> None:
    """Keys pick a person and lead to bad moments; a pointer reads any cell, a press goes there."""
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.by import By

    player.refresh()  # nobody is picked
    wait_until(player, "document.documentElement.dataset.ready === 'yes'")
    player.go_to(3)
    strips = player.find_elements(By.CSS_SELECTOR, "canvas.strip")
    rows = [plan["filmed"]["rows"] for plan in told(player.page_source)["plans"]]
    assert len(strips) == len(rows) == 2
    assert value(player, INKED % ("strip", 0)) > 0.5
    words = "document.querySelector('.told').textContent"

    def expected(row: dict[str, Any], step: int) -> str:
        views = row["views"][step]
        count = f"{views} camera{'' if views == 1 else 's'}" if views else "no camera sees "
        return f"person {row['person']}, step {step}: {count}"

    press(player, "p")
    wait_until(player, f"{words}.startsWith({json.dumps(expected(rows[0][1], 3))})")
    press(player, "o")
    wait_until(player, f"{words}.startsWith({json.dumps(expected(rows[0][0], 3))})")
    bad = sorted(
        step for plan in rows for row in plan
        for step, views in enumerate(row["views"]) if views < 2 and row["counts"][step]
    )  # fmt: skip
    press(player, "w")
    following = next((step for step in bad if step > 3), bad[0])
    wait_until(player, f"{words}.includes('step {following}:')")
    # The pointer at person 2 and step 7, from the strip's middle.
    wide, high = strips[0].size["width"], strips[0].size["height"]
    x = 46 + (7.5 / 12) * (wide - 56) - wide / 2
    y = (2.5 / 4 - 0.5) * high
    ActionChains(player).move_to_element_with_offset(strips[0], int(x), int(y)).perform()
    wait_until(player, f"{words}.startsWith({json.dumps(expected(rows[0][2], 7))})")
    angle = rows[0][2]["angles"][7]
    assert angle is None or f", {angle:.0f}°" in value(player, words)
    ActionChains(player).click().perform()
    wait_until(player, "document.getElementById('step').textContent.startsWith('step 7 ')")


@pytest.mark.slow
def test_what_a_camera_must_see_to_count_is_told_where_none_does(player: Any) -> None:
    """The part of a person is above the strip, and beside a 0 with the part that is seen."""
    keys = value(player, "document.querySelector('.keys').textContent")
    assert keys.startswith("cameras that see 30 % or more of a person")
    script = scripts(strip="filmedWords")
    for most, words in (
        (0.0, "no camera sees them"),
        (0.004, "no camera sees as much as 30 %; drone 2 sees the most, less than 1 %"),
        (0.29, "no camera sees as much as 30 %; drone 2 sees the most, 29 %"),
        (0.2999, "no camera sees as much as 30 %; drone 2 sees the most, 29 %"),
    ):
        row = {"name": "Ada", "views": [0], "angles": [None], "errors": [None], "counts": [True],
               "best": [2], "most": [most]}  # fmt: skip
        found = player.execute_script(f"{script}; return filmedWords({json.dumps(row)}, 0, 0.3)")
        assert found == f"Ada, step 0: {words}"


@pytest.mark.slow
def test_names_stay_while_there_is_room(tmp_path: Path) -> None:
    """Two who walk side by side have names both, and nothing above or below the picture is cut."""
    if not Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    problem = load_scene("delft", 0)
    long = f"{'a-long-name-of-a-plan-' * 4}end.json"
    found = planned(problem, "sequential", "greedy")
    plans = [(f"{name}-{long}", plan) for name, plan in found]
    Player(problem, plans).save(tmp_path / "page.html")
    with Browser.opened(tmp_path / "page.html") as browser:
        for size in ((1400, 900), (390, 844)):
            browser.execute_script(SPY)
            browser.resize(size)
            wait_until(browser, "window.written.has('Ada (0)') && window.written.has('lane')")
            written = set(value(browser, "[...window.written]"))
            assert {"Ada (0)", "Ben (1)", "Cleo (2)", "Dirk (3)"} <= written
            assert value(browser, CUT) == []


@pytest.mark.slow
def test_delft_is_on_one_screen(tmp_path: Path) -> None:
    """At 1400 x 900 the views of all five drones are in sight; on a phone no page is scrolled."""
    if not Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    problem = load_scene("delft", 0)
    Player(problem, planned(problem, "sequential")).save(tmp_path / "page.html")
    with Browser.opened(tmp_path / "page.html") as browser:
        browser.resize((1400, 900))
        chips = "[...document.querySelectorAll('.views .chip canvas')]"
        wait_until(browser, f"{chips}.length === 5")
        below = "document.querySelector('.fleet').getBoundingClientRect().bottom"
        bottoms = f"{chips}.map((c) => {below} - c.getBoundingClientRect().bottom)"
        assert min(value(browser, bottoms)) >= 0
        assert min(value(browser, f"{chips}.map((c) => c.clientHeight)")) >= 60
        browser.execute_script("document.getElementById('views').click()")  # off, as on a phone
        browser.resize((390, 844))
        assert value(browser, "document.documentElement.scrollHeight") <= 844


@pytest.mark.slow
def test_long_names_of_people_stand_above_their_rows(tmp_path: Path) -> None:
    """On a phone no name in the strip is cut, and a press on a row still picks its person."""
    if not Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    problem = load_scene("delft", 0)
    names = (
        "Bartholomew van der Meer",
        "Anna-Maria de Vries",
        "Cleo",
        "Dirk, who holds the microphone",
    )
    people = [replace(actor, name=name) for actor, name in zip(problem.actors, names, strict=True)]
    problem = problem.replace(actors=people)
    Player(problem, planned(problem, "sequential")).save(tmp_path / "page.html")
    with Browser.opened(tmp_path / "page.html") as browser:
        browser.execute_script(SPY)
        browser.resize((390, 844))
        wait_until(browser, "window.written.has('Cleo (2)')")
        assert {f"{name} ({j})" for j, name in enumerate(names)} <= set(
            value(browser, "[...window.written]")
        )
        height = value(browser, "document.querySelector('.strip').clientHeight")
        browser.execute_script(
            """const strip = document.querySelector(".strip");
            const { left, top } = strip.getBoundingClientRect();
            strip.dispatchEvent(new PointerEvent("pointermove", {
              clientX: left + 200, clientY: top + arguments[0], buttons: 0, bubbles: true }));""",
            height * 0.7,  # in the third of four rows
        )
        told = value(browser, "document.querySelector('.told').textContent")
        assert told.startswith("Cleo, step ")


# What is written on canvases from now on, and what of the page is cut or wider than its box.
SPY = """
window.written = new Set();
const write = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, ...more) {
  window.written.add(text);
  return write.call(this, text, ...more);
};
"""
CUT = """(
[...document.querySelectorAll('header *, .head *, .facts *, .about *, .chip *, #tabs *')].filter(
  (box) => box.clientWidth && box.scrollWidth > box.clientWidth + 1 && box.tagName !== 'CANVAS'
    && getComputedStyle(box).display !== 'inline' && !box.closest('.scalebar')
).map((box) => `${box.className} ${box.textContent}`))"""


@pytest.mark.slow
def test_keys_tell_what_is_seen_of_each_side_of_a_person(player: Any) -> None:
    """What a pointer finds under it, without one: S tells it of the person whom P and O pick."""
    player.refresh()  # nobody is picked
    wait_until(player, "document.documentElement.dataset.ready === 'yes'")
    player.go_to(6)
    (plan, _) = told(player.page_source)["plans"]
    for person in (0, 1):
        press(player, "s" if person == 0 else "p")
        said = value(player, "document.querySelector('.sides').textContent")
        names = ["front", "left", "back", "right", "top"]
        assert said.startswith(f"person {person}, px/m²: ")
        for name, pixels in zip(names, plan["seen"][6][5 * person :], strict=False):
            assert f"{name}: {f'{pixels:,.0f}' if pixels else 'not seen'}" in said
        assert value(player, "document.querySelector('.sides').classList.contains('on')")
        if person == 0:
            for key in "op":  # around to the last, and on to the first
                press(player, key)
    assert said.count("; ") == 4  # commas group digits only
    press(player, "s")
    assert not value(player, "document.querySelector('.sides').classList.contains('on')")


@pytest.mark.slow
def test_sides_in_halves_have_a_sum(tmp_path: Path) -> None:
    """Each side is told once, with the coverage of both of its triangles."""
    problem, page = tiny(), tmp_path / "page.html"
    actors = tuple(actor.replace(shape=TriangulatedCuboid()) for actor in problem.actors)
    problem = problem.replace(actors=actors)
    Player(problem, planned(problem, "greedy")).save(page)
    with Browser.opened(page) as driver:
        press(driver, "s")
        driver.go_to(1)
        said = value(driver, "document.querySelector('.sides').textContent")
        assert "half" not in said and said.count(";") == 4
        (plan,) = told(driver.page_source)["plans"]
        front = [f"{pixels:,.0f}" for pixels in plan["seen"][1][:2]]
        assert f"front: {' + '.join(front)};" in said or "front: not seen" in said


@pytest.mark.slow
def test_keys_that_lead_nowhere_say_so(tmp_path: Path) -> None:
    """Without marks of a kind the step stays, and a line tells why; the first P is the next."""
    problem, page = load_scene("delft", 0), tmp_path / "page.html"
    Player(problem, planned(problem, "greedy")).save(page)
    with Browser.opened(page) as driver:
        (plan,) = told(driver.page_source)["plans"]
        driver.go_to(2)
        kinds = {"c": plan["conflicts"], "n": plan["near"], "m": []}
        words = {"c": "no rule is broken", "n": "no close approaches",
                 "m": "the costs of moves are known only with a certificate"}  # fmt: skip
        for key, marks in kinds.items():
            assert marks == []
            press(driver, key)
            assert value(driver, "document.getElementById('said').textContent") == words[key]
            assert step_of(driver) == 2
        press(driver, "p")
        told_of = "document.querySelector('.told').textContent"
        wait_until(driver, f"{told_of}.startsWith('{problem.actors[1].name}')")


@pytest.mark.slow
def test_help_tells_all_keys(player: Any) -> None:
    """It opens by "?" and closes by Esc."""
    press(player, "?")
    assert value(player, "document.getElementById('help').open")
    assert value(player, "document.querySelectorAll('#keys dt').length") >= 15
    press(player, "\ue00c")
    assert not value(player, "document.getElementById('help').open")


@pytest.mark.slow
def test_a_plan_that_a_limit_stopped_at_the_starts_says_so(player: Any, tmp_path: Path) -> None:
    """The head names the limit, which the plan's file has, and says that no drone moves."""
    problem, page, path = tiny(), tmp_path / "show.html", tmp_path / "plan.json"
    stay = Plan(paths=tuple((robot.start,) * (problem.horizon + 1) for robot in problem.robots))
    SceneFile(problem=problem).save(tmp_path / "scene.json")
    PlanFile(
        scene=problem.name, digest=problem_digest(problem), planner="greedy", limit=Limit.TIME,
        reward=0.0, plan=stay,
    ).save(path)  # fmt: skip
    assert run("show", tmp_path / "scene.json", path, "-o", page) == 0
    with Browser.opened(page) as driver:
        assert value(driver, "document.querySelector('h2').textContent") == (
            "greedy, stopped by the time limit"
        )
        badge = value(driver, "document.querySelector('.badge').textContent")
        assert (
            badge == "no plan: stopped by the time limit during the search; "
            "all drones stay at their starts"
        )
        assert value(driver, "document.querySelector('.badge').className") == "badge mild"
        assert value(driver, "document.querySelector('.still').textContent") == "no drone moves"
    assert value(player, "document.querySelector('.still')") is None


@pytest.mark.slow
def test_a_picture_with_the_focus_is_turned_by_arrows(player: Any) -> None:
    """With shift they move it; + and - zoom from anywhere. The step stays as it is."""
    from selenium.webdriver.common.keys import Keys

    press(player, "3")
    player.go_to(6)
    picture = "document.querySelector('canvas.view').toDataURL()"
    seen = [value(player, picture)]
    player.execute_script("document.querySelector('canvas.view').focus()")
    for keys in (Keys.LEFT, Keys.UP, Keys.SHIFT + Keys.LEFT, "+"):
        player.switch_to.active_element.send_keys(keys)
        player.go_to(6)
        seen.append(value(player, picture))
    assert len(set(seen)) == 5 and step_of(player) == 6
    player.execute_script("document.activeElement.blur()")
    press(player, "3")
    player.go_to(6)
    assert value(player, picture) == seen[0]


@pytest.mark.slow
def test_a_tap_tells_what_is_under_the_finger(player: Any) -> None:
    """As a pointer does, and it stays when the finger is gone."""
    player.go_to(6)
    tip = "document.querySelector('.tip')"
    view = player.execute_script(
        "const box = document.querySelector('canvas.view').getBoundingClientRect();"
        "return [box.left, box.top, box.width, box.height]"
    )
    for k in range(400):  # somewhere in the picture is a face
        x, y = view[0] + view[2] * (0.2 + k % 20 / 33), view[1] + view[3] * (0.2 + k // 20 / 33)
        for kind, points in (("touchStart", [{"x": x, "y": y}]), ("touchEnd", [])):
            event = {"type": kind, "touchPoints": points}
            player.execute_cdp_cmd("Input.dispatchTouchEvent", event)
        if value(player, f"{tip}.classList.contains('on') && {tip}.textContent.includes('person')"):
            break
    assert re.match(r"person \d, \w+: |drone \d, films person", value(player, f"{tip}.textContent"))
    press(player, "\ue00c")


def axe() -> str:
    """The script of axe-core, which npm has installed for all (`npm install -g axe-core`)."""
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("needs npm, and axe-core by `npm install -g axe-core`")
    root = subprocess.run([npm, "root", "-g"], capture_output=True, text=True, check=True)
    script = Path(root.stdout.strip(), "axe-core", "axe.min.js")
    if not script.exists():
        pytest.skip("needs axe-core: npm install -g axe-core")
    return script.read_text("utf-8")


@pytest.mark.slow
def test_axe_finds_nothing(player: Any, tmp_path: Path) -> None:
    """By day and by night, on wide and on narrow screens, of few drones and of many.

    Targets are large enough for fingers.
    """
    script, before = axe(), player.current_url
    audit = """const done = arguments[0], rules = { "target-size": { enabled: true } };
        axe.run(document, { rules, resultTypes: ["violations"] }).then((found) =>
          done(found.violations.map(({ id, impact, nodes }) => [id, impact, nodes[0].html])))"""
    Player(*many()).save(tmp_path / "crowd.html")
    for page in (before, (tmp_path / "crowd.html").as_uri()):
        player.get(page)
        press(player, "d")
        for size in ((1280, 800), (390, 844), (844, 390)):
            player.resize(size)
            for mode in ("dark", "light"):
                screen = [{"name": "prefers-color-scheme", "value": mode}]
                player.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": screen})
                player.go_to(3)
                player.execute_script(script)
                assert player.execute_async_script(audit) == []
    player.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    player.resize((1280, 800))
    player.get(before)
    player.go_to(3)


def many() -> tuple[Problem, list[tuple[str, Plan]]]:
    """The bottleneck with 16 drones that stay, four in each place."""
    problem = load_scene("bottleneck", 0).replace(rules=CollisionRules(vertex=False, swap=False))
    robots = tuple(problem.robots[k % 4] for k in range(16))
    stay = Plan(paths=tuple((robot.start,) * (problem.horizon + 1) for robot in robots))
    return problem.replace(robots=robots), [("stay", stay)]


@pytest.mark.slow
def test_the_picture_is_recorded_as_a_video(player: Any) -> None:
    """From the first step to the last; the file has a name, and begins as WebM does."""
    player.refresh()
    wait_until(player, "document.documentElement.dataset.ready === 'yes'")
    pressed = "document.getElementById('film').getAttribute('aria-pressed')"
    begun = player.execute_script(
        """
        window.videos = [];
        URL.createObjectURL = (blob) => {
          blob.arrayBuffer().then((bytes) => videos.push([...new Uint8Array(bytes)]));
          return "#";
        };
        HTMLAnchorElement.prototype.click = function () { window.named = this.download; };
        const speed = document.getElementById("speed");
        speed.value = "16";
        speed.dispatchEvent(new Event("change"));
        document.getElementById("film").click();
        return """
        + pressed
    )
    assert begun == "true"
    wait_until(player, "window.videos.length === 1")
    assert value(player, pressed) == "false" and step_of(player) == 11
    assert value(player, "window.named") == "bottleneck greedy 16 steps per second.webm"
    video = value(player, "videos[0]")
    assert bytes(video[:4]) == b"\x1aE\xdf\xa3" and len(video) > 10_000
    player.refresh()


@pytest.mark.slow
def test_a_crowd_has_the_colours_of_its_tasks_and_numbers_on_demand(
    player: Any, tmp_path: Path
) -> None:
    """Of more than 14 drones; the list says whom each films and what it adds.

    The legend names those people; they stand on discs of these colours.
    """
    page, before = tmp_path / "page.html", player.current_url
    Player(*many()).save(page)
    player.get(page.as_uri())
    player.go_to(3)
    dots = "[...document.querySelectorAll('.chip i')].map((dot) => dot.style.background)"
    data = told(player.page_source)
    (plan,) = data["plans"]
    colours = [task["colour"] for task in data["tasks"]]
    rgb = [tuple(int(colour[k : k + 2], 16) for k in (1, 3, 5)) for colour in colours]
    filmed = [(127, 127, 127) if task is None else rgb[task] for task in plan["tasks"]]
    assert value(player, dots) == [f"rgb{colour}" for colour in filmed]
    assert len({*filmed}) > 2
    legend = value(player, "[...document.querySelectorAll('.task')].map((e) => e.textContent)")
    assert legend == [f" {k}" for k in sorted({*plan["tasks"]} - {None})] + [" nobody"]
    rows = "[...document.querySelectorAll('.chip')].map((row) => [row.querySelector('.films')"
    rows += ".textContent, row.querySelector('.adds').textContent])"
    for (films, adds), whom, added in zip(
        value(player, rows), plan["films"], plan["adds"], strict=True
    ):
        assert films == ("nobody" if whom[3] is None else f"person {whom[3]}")
        assert float(adds.replace(",", "")) == pytest.approx(added[3], rel=5e-3)
    # Pictures of those that are in sight, of the others when they come there.
    drawn = "[...document.querySelectorAll('.chip canvas')].filter((c) => c.width !== 300).length"
    assert 2 <= value(player, drawn) <= 15
    plain = value(player, INKED % ("view", 0))
    press(player, "d")
    player.go_to(3)
    assert value(player, INKED % ("view", 0)) != plain
    player.get(before)
    named = """const labels = new Labels({ plan: arguments[0] });
        return [{}, { picked: 3 }, { hovered: { drone: 3 } }, { hovered: { drone: 4 } }]
          .map((options) => labels.isNamed(3, 0, options))"""
    crowd = {"paths": [[0]] * 15, "conflicts": [], "near": []}
    near = crowd | {"near": [{"time": 0, "robots": [3, 5]}]}
    script = scripts(labels="Labels") + named
    assert player.execute_script(script, crowd) == [False, True, True, False]
    assert player.execute_script(script, near) == [True] * 4
    assert player.execute_script(script, crowd | {"paths": [[0]] * 14}) == [True] * 4


@pytest.mark.slow
def test_all_drones_pictures_stand_beside_the_scene(player: Any, tmp_path: Path) -> None:
    """At first where there is one plan, else by V; they follow the steps."""
    player.refresh()
    wait_until(player, "document.documentElement.dataset.ready === 'yes'")
    shown = "document.getElementById('views').checked"
    assert not value(player, shown)
    page, before = tmp_path / "page.html", player.current_url
    problem = load_scene("bottleneck", 0)
    Player(problem, planned(problem, "cocap")).save(page)
    player.get(page.as_uri())
    assert value(player, shown)
    pictures = (
        "[...document.querySelectorAll('.chip canvas')].slice(0, 2).map((c) => c.toDataURL())"
    )
    seen = []
    for step in (3, 8):
        player.go_to(step)
        seen += value(player, pictures)
    assert len(set(seen)) == 4
    press(player, "v")
    player.go_to(8)
    assert value(player, "document.querySelector('.chip canvas').offsetWidth") == 0
    player.get(before)


@pytest.mark.slow
def test_seconds_stand_beside_steps_where_they_are_known(player: Any, tmp_path: Path) -> None:
    """In the display, below the slider and for those who hear it; else steps alone."""
    assert value(player, "document.getElementById('seconds').textContent") == ""
    ticks = "[...document.querySelectorAll('#times span')].map((tick) => tick.textContent)"
    assert value(player, ticks) == ["0", "5", "10"]
    problem, page = load_scene("bottleneck", 0).replace(step=0.5), tmp_path / "page.html"
    Player(problem, planned(problem, "cocap")).save(page)
    with Browser.opened(page) as driver:
        driver.go_to(5)
        assert value(driver, "document.getElementById('seconds').textContent") == "2.5 s of 5.5 s"
        assert value(driver, ticks) == ["0 s", "2 s", "4 s"]
        said = "document.getElementById('slider').getAttribute('aria-valuetext')"
        assert value(driver, said) == "step 5, 2.5 s"


@pytest.mark.slow
def test_close_approaches_and_hovering_drones_are_told_in_red(tmp_path: Path) -> None:
    """The badge is green only if drones are as far apart as they should fly, red if they touch.

    It says "no conflicts" in green alone.
    """
    if not Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    problem, crossed = crossing()
    stay = Plan(paths=tuple((path[0],) * 2 for path in crossed.paths))
    one = Plan(paths=((crossed.paths[0][0],) * 2, (crossed.paths[1][0], State(2, 0, 0, 0, 0))))
    page = tmp_path / "page.html"
    Player(problem, [("crossed", crossed), ("stay", stay), ("one", one)]).save(page)
    panels = "[...document.querySelectorAll('.panel')]"
    with Browser.opened(page) as driver:
        badges = value(driver, f"{panels}.map((p) => p.querySelector('.badge').textContent)")
        last = f"{panels}.map((p) => [...p.querySelectorAll('.badge')].at(-1))"
        words = value(driver, f"{last}.map((badge) => badge.textContent)")
        one_metre = "no rule broken, but 1 m apart ▸"
        assert words == ["drones touch: 0 m ▸", one_metre, one_metre]
        levels = value(driver, f"{last}.map((badge) => badge.className)")
        assert levels == [f"badge next {level}" for level in ("bad", "mild", "mild")]
        assert badges[1] == "no drone moves"
        value(driver, f"{last}[0].click()")
        said = "drones 0 and 1 collide"
        wait_until(driver, f"document.querySelector('.words').textContent === '{said}'")
        assert value(driver, "document.querySelector('.words').className") == "words"
        still = value(driver, f"{panels}.map((p) => p.querySelector('.still')?.textContent ?? '')")
        assert still == ["", "no drone moves", "1 drone hovers"]
        red = value(driver, "getComputedStyle(document.querySelector('.still')).color")
        marks = "[...document.querySelectorAll('.mark.near')].map((e) => getComputedStyle(e).color)"
        assert [colour == red for colour in value(driver, marks)] == [True, False, False]
        flights = f"{panels}.map((p) => p.querySelector('.flight')?.textContent ?? '')"
        assert value(driver, flights) == ["smooth", "", "smooth"]
    ruled = problem.replace(rules=CollisionRules(separation=0.9))
    Player(ruled, [("stay", stay)]).save(page)
    with Browser.opened(page) as driver:
        badge = "[...document.querySelectorAll('.badge')].at(-1)"
        assert value(driver, f"{badge}.className") == "badge next good"
        assert value(driver, f"{badge}.textContent") == "no conflicts; closest 1 m ▸"


@pytest.mark.slow
def test_controls_come_before_drones_by_keys(player: Any) -> None:
    """Tab leads to play and the slider first, and to one drone only; arrows lead to the others."""
    from selenium.webdriver.common.keys import Keys

    player.refresh()
    wait_until(player, "document.documentElement.dataset.ready === 'yes'")
    focused, here = [], "document.activeElement"
    name = f"{here}.id || {here}.className"
    for _ in range(40):
        player.switch_to.active_element.send_keys(Keys.TAB)
        focused.append(value(player, name))
    assert focused[:2] == ["play", "slider"]
    first = focused.index("chip")
    assert focused[first : first + 2] != ["chip", "chip"]
    player.execute_script("document.querySelector('.chip').focus()")
    player.switch_to.active_element.send_keys(Keys.DOWN)
    assert value(player, f"{here}.textContent").startswith("1")
    order = "[...document.querySelectorAll('.fleet')[0].querySelectorAll('.chip')]"
    assert value(player, f"{order}.map((chip) => chip.tabIndex)") == [-1, 0, -1, -1]
    player.execute_script("document.activeElement.blur()")


@pytest.mark.slow
def test_a_phone_has_targets_for_fingers(tmp_path: Path) -> None:
    """They are 24 px high or more, and 44 px where fingers are what points.

    The box of the picked drone lies on the picture, of which it covers little: what the drone sees
    is in the list. Many drones are seen from above, without cones.
    """
    page = tmp_path / "field.html"
    airspace = Airspace(people_aside=0.01)  # of which the badge says nothing, so it is one line
    problem = load_scene("field-large", 5).replace(airspace=airspace)
    still = Plan(paths=tuple((robot.start,) * 4 for robot in problem.robots))
    Player(problem.replace(horizon=3), [("still", still)]).save(page)
    heights = """[...document.querySelectorAll(
        "#slider, .hold, .mark, .badge.next, footer label, footer button")]
      .filter((target) => target.offsetParent)
      .map((target) => [target.textContent, Math.max(target.getBoundingClientRect().height,
        parseFloat(getComputedStyle(target, "::after").height) || 0)])"""
    outside = """["top", "bottom", "left", "right"].map((side) =>
      document.querySelector(".inset").getBoundingClientRect()[side] -
      document.querySelector(".place").getBoundingClientRect()[side])"""
    with Browser.opened(page) as browser:
        browser.resize((390, 844))
        for _ in range(13):
            press(browser, "d")  # a number of two digits takes more room
        browser.go_to(2)
        value(browser, "document.getElementById('more').click()")
        assert [one for one in value(browser, heights) if one[1] < 24] == []
        browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True})
        assert value(browser, "matchMedia('(pointer: coarse)').matches")
        assert [one for one in value(browser, heights) if one[1] < 44] == []
        assert len(value(browser, heights)) > 12
        pills = "[...document.querySelectorAll('.mark, .badge.next')].map((e) => e.offsetHeight)"
        assert max(value(browser, pills)) <= 28  # the room for fingers is around them
        browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})
        area = "(({ offsetWidth, offsetHeight }) => offsetWidth * offsetHeight)"
        covered, whole = (
            value(browser, f"{area}(document.querySelector('{name}'))")
            for name in (".inset", ".place")
        )
        assert covered < 0.15 * whole
        browser.refresh()
        wait_until(browser, "document.documentElement.dataset.ready === 'yes'")
        assert value(browser, "document.getElementById('top').ariaPressed") == "true"
        assert not value(browser, "document.getElementById('sights').checked")
        assert value(browser, "document.getElementById('views').checked")
        press(browser, "d")
        browser.go_to(2)
        top, bottom, left, right = value(browser, outside)
        assert top >= 0 and left >= 0 and bottom <= 0 and right <= 0
        row = "document.querySelector('.inset .bar')"
        assert value(browser, f"{row}.scrollWidth <= {row}.clientWidth")
        assert value(browser, "document.documentElement.scrollWidth") <= 390


@pytest.mark.slow
def test_numbers_of_the_chart_stand_apart_on_a_phone(tmp_path: Path) -> None:
    """Fewer of them where the chart is low."""
    page, problem = tmp_path / "field.html", load_scene("field", 0)
    Player(problem, planned(problem, "greedy")).save(page)
    spy = """const write = CanvasRenderingContext2D.prototype.fillText; window.written = [];
        CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
          if (this.canvas.className === "chart" && this.textAlign === "right") written.push(y);
          write.call(this, text, x, y);
        };"""
    with Browser.opened(page) as browser:
        browser.resize((390, 844))
        browser.go_to(2)
        browser.execute_script(spy)
        browser.go_to(3)
        heights = sorted(set(value(browser, "window.written")))
        assert len(heights) >= 3  # with the words above
        assert min(np.diff(heights)) >= 13


@pytest.mark.slow
def test_a_phone_on_its_side_shows_the_picture(tmp_path: Path) -> None:
    """Options are shown on demand, numbers have one line, and the bar at the bottom one row."""
    page = tmp_path / "delft.html"
    problem = load_scene("delft", 0)
    still = Plan(paths=tuple((robot.start,) * 4 for robot in problem.robots))
    Player(problem.replace(horizon=3), [("still", still)]).save(page)
    high = "document.querySelector('%s').offsetHeight"
    with Browser.opened(page) as browser:
        browser.resize((844, 390))
        browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True})
        browser.go_to(2)
        assert value(browser, high % "footer") <= 64
        assert value(browser, high % ".facts") <= 26
        top = value(browser, "document.querySelector('.place').getBoundingClientRect().top")
        assert 390 - 64 - top >= 190 and value(browser, high % ".place") >= 200
        assert value(browser, "document.documentElement.scrollWidth") <= 844
        value(browser, "document.getElementById('more').click()")
        assert value(browser, high % "#options") > 0


@pytest.mark.slow
def test_a_phone_shows_one_plan_and_a_switch(player: Any) -> None:
    """On a narrow screen nothing stands out at the side or is cut; two fingers zoom the picture."""
    from selenium.webdriver.common.by import By

    player.resize((390, 844))
    player.go_to(2)
    assert value(player, "document.documentElement.scrollWidth") <= 390
    shown = "[...document.querySelectorAll('.panel')].map((p) => p.offsetHeight > 300)"
    assert value(player, shown) == [True, False]
    assert value(player, INKED % ("view", 0)) > 0.1
    press(player, "d")
    cut = """[...document.querySelectorAll("footer *, .chosen .inset *")].filter((part) =>
        part.getBoundingClientRect().right > part.closest("footer, .inset").clientWidth
        + part.closest("footer, .inset").getBoundingClientRect().left + 2)"""
    assert value(player, f"{cut}.length") == 0
    press(player, "\ue00c")
    player.find_elements(By.CSS_SELECTOR, "#tabs button")[1].click()
    assert value(player, shown) == [False, True]
    player.go_to(2)
    before = value(player, "document.querySelector('.chosen canvas.view').toDataURL()")
    for kind, points in (("touchStart", (170, 220)), ("touchMove", (120, 270)), ("touchEnd", ())):
        fingers = [{"x": x, "y": 400, "id": k} for k, x in enumerate(points)]
        event = {"type": kind, "touchPoints": fingers}
        player.execute_cdp_cmd("Input.dispatchTouchEvent", event)
    player.go_to(2)
    assert value(player, "document.querySelector('.chosen canvas.view').toDataURL()") != before
    player.find_elements(By.CSS_SELECTOR, "#tabs button")[0].click()
    player.resize((1280, 800))
    player.go_to(2)


@pytest.mark.slow
def test_closed_airspace_is_drawn_and_can_be_switched_off(player: Any, tmp_path: Path) -> None:
    """In red, with its limits in the legend; where nothing is closed there is no entry for it."""
    dark, red = "d[i] + d[i + 1] + d[i + 2] < 750", "d[i] > 25 + Math.max(d[i + 1], d[i + 2])"
    assert dark in INKED
    red = INKED.replace(dark, red) % ("view", 0)
    wide = "['airspace', 'closing'].map((id) => document.getElementById(id).offsetWidth)"
    assert value(player, wide) == [0, 0]
    problem, page, before = shut_in(), tmp_path / "page.html", player.current_url
    Player(problem).save(page)
    player.get(page.as_uri())
    player.go_to(1)
    said = value(player, "document.getElementById('airspace').innerText")
    assert said == f"closed to drones: {problem.airspace}"
    shown = value(player, red)
    player.execute_script("document.getElementById('closed').click()")
    player.go_to(1)
    assert shown > 0.015 + 2 * value(player, red)
    assert player.get_log("browser") == []
    player.get(before)


def pictures(player: Any) -> list[Any]:
    """Pictures of the page as arrays [H, W, 3], but for those that are not shown."""
    urls = value(
        player,
        """[...document.querySelectorAll("canvas.view, .inset canvas")]
        .filter((canvas) => canvas.clientWidth).map((canvas) => canvas.toDataURL())""",
    )
    return [
        np.asarray(Image.open(BytesIO(b64decode(url.split(",")[1]))).convert("RGB")).astype(int)
        for url in urls
    ]


def unlike(one: Any, other: Any) -> float:
    """Share of the samples of two pictures whose colours differ by more than can be overlooked."""
    assert one.shape == other.shape
    return float((np.abs(one - other).max(axis=2) > 12).mean())


@pytest.mark.slow(seconds=9)
def test_a_graphics_card_draws_the_same(tmp_path: Path) -> None:
    """WebGL, in software here, and the raster: walls cut off, closed airspace, cones, cameras.

    Pictures differ along some edges only, by day and by night, and in each view.
    """
    if not Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    closed, bottleneck = shut_in(), load_scene("bottleneck", 0)
    stay = Plan(paths=tuple((robot.start,) * 3 for robot in closed.robots))
    for name, scene, plan in (
        ("bottleneck", bottleneck, planned(bottleneck, "cocap")[0][1]), ("closed", closed, stay),
    ):  # fmt: skip
        Player(scene, [(name, plan)]).save(tmp_path / f"{name}.html")
    for name, mode in (("bottleneck", "light"), ("bottleneck", "dark"), ("closed", "light")):
        page, drawn = (tmp_path / f"{name}.html").as_uri(), {}
        for renderer in ("raster", "webgl"):
            with Browser.opened(f"{page}?renderer={renderer}", (900, 700)) as driver:
                screen = [{"name": "prefers-color-scheme", "value": mode}]
                driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": screen})
                assert value(driver, "document.documentElement.dataset.renderer") == renderer
                drawn[renderer] = []
                for keys in ("d", "t", "f", "b"):
                    press(driver, keys)
                    driver.go_to(2)
                    drawn[renderer] += pictures(driver)
        assert len(drawn["raster"]) == 8
        for one, other in zip(drawn["raster"], drawn["webgl"], strict=True):
            assert len(np.unique(one.reshape(-1, 3), axis=0)) > 50  # something is there
            assert unlike(one, other) < 0.01
        assert unlike(drawn["raster"][0], drawn["webgl"][2]) > 0.05  # the view from above


# Keeps the page's WebGL contexts, so that they can be lost.
CONTEXTS = """window.contexts = [];
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (...how) {
  const context = getContext.apply(this, how);
  if (how[0] === "webgl2" && context) window.contexts.push(context);
  return context;
};"""


@pytest.mark.slow
def test_pictures_of_a_lost_graphics_card_are_drawn_by_the_processor(player: Any) -> None:
    """At once, and the same; software that poses as a card is not asked unless the page says so."""
    before = player.current_url
    shown = "document.documentElement.dataset.renderer"
    assert value(player, shown) == "raster"
    kept = player.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": CONTEXTS})
    player.get(f"{before}?renderer=webgl")
    player.go_to(4)
    drawn = pictures(player)
    assert value(player, shown) == "webgl" and value(player, "contexts.length") == 1
    value(player, "contexts[0].getExtension('WEBGL_lose_context').loseContext()")
    wait_until(player, f"{shown} === 'raster'")
    player.go_to(4)
    for one, other in zip(drawn, pictures(player), strict=True):
        assert unlike(one, other) < 0.01
    player.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", kept)
    player.get(before)
    player.get_log("browser")  # software says that it is slow


# Whether rays to the eye are blocked.
BLOCKED = """
const [scene, rays, opened] = arguments, all = new Rays(scene, new Blocks(scene));
return rays.map(([from, way, most]) => all.isBlocked(from, way, most, opened));
"""


@pytest.mark.slow
def test_what_stands_before_a_drone_hides_it(player: Any) -> None:
    """A block that is not cut off does, and a hill; what is cut off, or too far away, does not."""
    scene = {
        "terrain": {"cell": 1, "cells": [6, 1], "grounds": [0, 0, 0, 0, 3, 0],
                    "heights": [0, 5, 0, 0, 3, 0]},
        "meshes": [], "boxes": [],
    }  # fmt: skip
    rays = [((0.5, 0.5, 1), (1, 0, 0), 2), ((0.5, 0.5, 1), (1, 0, 0), 0.4),
            ((0.5, 0.5, 6), (1, 0, 0), 5), ((2.5, 0.5, 1), (1, 0, 0), 3)]  # fmt: skip
    script = scripts(blocks="Blocks", rays="Rays") + BLOCKED
    assert player.execute_script(script, scene, rays, [0]) == [True, False, False, True]
    assert player.execute_script(script, scene, rays, [1]) == [False, False, False, True]


@pytest.mark.slow
def test_no_name_is_run_and_nothing_is_asked_for(player: Any, tmp_path: Path) -> None:
    """A scene and a plan with code for names are shown by them, and nothing is loaded.

    Where nothing is seen, no scale says how well.
    The console stays empty, whatever the tests above did to the page before.
    """
    problem, page = hills().replace(name=EVIL), tmp_path / "page.html"
    stay = Plan(paths=tuple((robot.start,) * 3 for robot in problem.robots))
    assert not seen_by(problem, stay).any()
    page.write_text(Player(problem, [(EVIL, stay)]).page(), "utf-8")
    before = player.current_url
    player.get(page.as_uri())
    player.go_to(1)
    assert value(player, "document.getElementById('name').textContent") == problem.name
    assert value(player, "document.querySelector('.panel h2').textContent") == EVIL
    assert value(player, "document.querySelectorAll('img').length") == 0
    assert value(player, "document.getElementById('scale').offsetWidth") == 0
    assert value(player, "performance.getEntriesByType('resource').length") == 0
    assert player.get_log("browser") == []
    player.get(before)


@pytest.mark.slow(seconds=9)
def test_the_badge_offers_the_certificate(tmp_path: Path) -> None:
    """A press tells its digest and the commands; its link has the file's bytes; keys rest."""
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.wait import WebDriverWait

    if not Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    plan, proof, page = (tmp_path / name for name in ("plan.json", "proof.json", "film.html"))
    assert run("plan", "tiny-queue", "-o", plan) == 0
    assert run("bound", "tiny-queue", "--start", plan, "-o", proof) == 0
    assert run("show", "tiny-queue", plan, "--certificate", proof, "-o", page) == 0
    digest = hashlib.sha256(proof.read_bytes()).hexdigest()
    with Browser.opened(page) as driver:
        badge = "document.querySelector('.badge')"
        assert value(driver, f"{badge}.textContent") == "proved optimal ▸"
        assert value(driver, f"{badge}.className") == "badge next good"
        value(driver, f"{badge}.click()")
        box = "document.querySelector('dialog.proof')"
        assert value(driver, f"{box}.open")
        text = value(driver, f"{box}.textContent")
        assert digest in text
        assert f"cocap-opt verify tiny-queue {plan} {proof}" in text
        assert "cocap-check tiny-queue.instance" in text
        assert value(driver, f"{box}.querySelector('a[download]').download") == "proof.json"
        behaviour = {"behavior": "allow", "downloadPath": str(tmp_path / "loaded")}
        driver.execute_cdp_cmd("Browser.setDownloadBehavior", behaviour)
        value(driver, f"{box}.querySelector('a[download]').click()")
        loaded = tmp_path / "loaded" / "proof.json"
        WebDriverWait(driver, 20).until(lambda _: loaded.is_file() and loaded.read_bytes())
        assert loaded.read_bytes() == proof.read_bytes()
        before = step_of(driver)
        focused = driver.switch_to.active_element
        focused.send_keys(Keys.END)
        assert step_of(driver) == before
        focused.send_keys(Keys.ESCAPE)
        assert not value(driver, f"{box}.open")
        press(driver, Keys.END)
        wait_until(
            driver, f"!document.getElementById('step').textContent.includes('step {before} ')"
        )
        assert driver.get_log("browser") == []
