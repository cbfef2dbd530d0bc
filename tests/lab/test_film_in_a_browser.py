"""Films of plans, made with a browser."""

import io
import os
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from players import plans as plans
from players import run

from cocap_opt.player import chromium
from cocap_opt.player.chromium import Chromium, ChromiumError
from cocap_opt.player.film import filmed_plans
from cocap_opt.player.filming import FILMS, Filming
from cocap_opt.player.player import Player
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import never

pytestmark = pytest.mark.skipif(Chromium.program() is None, reason="needs chromium")
PAGE = "<!doctype html><html data-ready='yes'><body style='background: #f00'>"


@pytest.fixture
def groups(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Process groups of the browsers that are started."""
    found, real = list[int](), subprocess.Popen

    def started(*words: Any, **how: Any) -> Any:
        process = real(*words, **how)
        found.append(process.pid)
        return process

    monkeypatch.setattr(chromium.subprocess, "Popen", started)
    return found


def require_ended(groups: list[int]) -> None:
    """Each browser has ended, with all of its processes."""
    assert groups
    for group in groups:
        for _ in range(100):  # they are killed, and end a little later
            try:
                os.killpg(group, 0)
            except ProcessLookupError:
                break
            time.sleep(0.05)
        else:
            raise AssertionError(f"group {group} is still there")


def decoded(path: Path) -> list[Any]:
    """The pictures of a film, as arrays [H, W, 3]."""
    if path.suffix in (".gif", ".webp"):
        with Image.open(path) as film:
            found = []
            for number in range(film.n_frames):
                film.seek(number)
                found.append(np.asarray(film.convert("RGB")).astype(int))
            return found
    av = pytest.importorskip("av")
    with av.open(path) as container:
        return [frame.to_ndarray(format="rgb24").astype(int) for frame in container.decode(video=0)]


@pytest.mark.slow(seconds=20)
def test_films_show_the_plan_from_its_first_step_to_its_last(
    plans: Path, tmp_path: Path, groups: list[int], capsys: pytest.CaptureFixture[str]
) -> None:
    """Each kind has all pictures, of the size asked for, and they are the player's."""
    last = {}
    for suffix in FILMS:
        if suffix in (".webm", ".mp4"):
            pytest.importorskip("av")
        path = tmp_path / f"film{suffix}"
        how = ["--size", "400x300", "--speed", "40", "--view", "3d", "-o", path]
        assert run("show", "bottleneck", plans / "cocap.json", *how) == 0
        pictures, rate = decoded(path), {".gif": 10, ".webp": 15}.get(suffix, 30)
        count = int(10 / (40 / rate) + 1e-9) + 1
        lingers = rate if suffix in (".webm", ".mp4") else 0  # else the last one takes longer
        assert count + lingers <= len(pictures) <= count + 1 + lingers
        assert {picture.shape for picture in pictures} == {(300, 400, 3)}
        assert np.abs(pictures[0] - pictures[-1]).max() > 60
        last[suffix] = pictures[-1]
    for picture in last.values():
        assert np.abs(picture - last[".webp"]).mean() < 6
    require_ended(groups)
    assert {path.name for path in tmp_path.iterdir()} == {f"film{suffix}" for suffix in FILMS}


@pytest.mark.slow
def test_a_film_from_above_is_another(tmp_path: Path) -> None:
    """Its pictures are those of the map; two plans stand side by side."""
    problem = load_scene("tiny-queue", 0)
    player, drawn = Player(problem), {}
    for view in ("3d", "above"):
        filming = Filming(".webp", view, (400, 300), 60.0)
        content, count = filmed_plans(player, filming, never, lambda *_: None)
        with Image.open(io.BytesIO(content)) as picture:
            drawn[view] = np.asarray(picture.convert("RGB")).astype(int)
        assert count >= 2
    assert (np.abs(drawn["3d"] - drawn["above"]).max(axis=2) > 12).mean() > 0.03


@pytest.mark.slow
def test_a_film_that_is_stopped_leaves_nothing(
    plans: Path, tmp_path: Path, groups: list[int], capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """By a time limit, which says how far it came, and by Ctrl-C; no browser is left."""
    path = tmp_path / "film.webp"
    film = ["show", "bottleneck", plans / "cocap.json", "-o", path, "--size", "400x300"]
    capsys.readouterr()
    assert run(*film, "--time-limit", "0") == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert "the time limit was reached after 0 of 76 pictures, so there is no film" in said
    taken = Chromium.picture

    def interrupted(browser: Chromium) -> bytes:
        monkeypatch.setattr(Chromium, "picture", lambda _: raised())
        return taken(browser)

    def raised() -> bytes:
        raise KeyboardInterrupt

    monkeypatch.setattr(Chromium, "picture", interrupted)
    assert run(*film) == 130
    assert list(tmp_path.iterdir()) == []
    assert len(groups) == 2
    require_ended(groups)


@pytest.mark.slow
def test_a_browser_that_fails_says_so(
    tmp_path: Path, groups: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An error of the page, a page that is never ready, a browser that ends, or is none."""
    program = Chromium.program()
    assert program is not None
    with Chromium.opened(program, PAGE, "", (200, 100)) as browser:
        with Image.open(io.BytesIO(browser.picture())) as picture:
            assert picture.size == (200, 100) and picture.convert("RGB").getpixel((9, 9)) == (
                255, 0, 0,
            )  # fmt: skip
        with pytest.raises(ChromiumError, match="the page failed: ReferenceError: none is not"):
            browser.value("none")
        assert browser.value("[1, { a: null }]") == [1, {"a": None}]
        os.killpg(groups[0], 9)
        with pytest.raises(ChromiumError, match="the browser has ended"):
            browser.value("1")
    monkeypatch.setattr(chromium, "_PATIENCE", 2.0)
    with (
        pytest.raises(ChromiumError, match="not ready within a minute"),
        Chromium.opened(program, "<p>", "", (200, 100)),
    ):
        pass
    with (
        pytest.raises(ChromiumError, match="the browser has ended"),
        Chromium.opened("/bin/false", PAGE, "", (200, 100)),
    ):
        pass
    require_ended(groups)
