"""Films of plans: what is asked for, and what is said where none can be made.

Those that need a browser are in `tests/lab/test_film_in_a_browser.py`.
"""

from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from players import plans as plans
from players import run

from cocap_opt.player import film
from cocap_opt.player.chromium import NAMES, Chromium
from cocap_opt.player.filming import FILMS, Filming


@given(
    suffix=st.sampled_from(FILMS),
    speed=st.floats(0.1, 60),
    first=st.integers(0, 1),
    steps=st.integers(1, 60),
)
def test_pictures_are_evenly_apart_from_the_first_step_to_the_last(
    suffix: str, speed: float, first: int, steps: int
) -> None:
    """As far apart as the speed and the rate say, and the last is the last step."""
    filming = Filming(suffix, "3d", (200, 200), speed)
    times = filming.times(first, first + steps, usual=3.0)
    each = speed / filming.rate
    assert times[0] == first and times[-1] == pytest.approx(first + steps)
    assert len(times) <= steps / each + 2
    for before, after in pairwise(times[:-1]):
        assert after - before == pytest.approx(each, rel=1e-6)
    assert times[-1] == first + steps or times[-1] - times[-2] <= each * (1 + 1e-6)
    assert Filming(suffix, "3d", (200, 200), None).times(0, 2, speed) == Filming(
        suffix, "3d", (200, 200), speed
    ).times(0, 2, 1.0)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["-o", "film.webm", "--view", "side"], "--view: must be one of 3d, above"),
        (["-o", "film.webm", "--size", "1280"], "--size: must be two even numbers 200..3840 such"),
        (["-o", "film.webm", "--size", "1281x720"], "--size: must be two even numbers"),
        (["-o", "film.webm", "--speed", "0"], "--speed: must be 0.1..60 steps a second, not 0"),
        (
            ["-o", "film.webm", "--steps", "3"],
            "--steps: requires a plan, and a picture: players and",
        ),
        (
            ["-o", "plan.png", "--speed", "3"],
            "--speed: must be left out for .png, as it is not a film",
        ),
        (["-o", "plan.pdf", "--time-limit", "3"], "--time-limit: must be left out for .pdf"),
        (["-o", "plan.html", "--view", "3d", "--time-limit", "3"], "--view, --time-limit: must be"),
        (["-o", "film.webm", "--time-limit", "-1"], "--time-limit: must be a number of seconds"),
    ],
)
def test_what_films_do_not_take_is_said(
    words: list[str], said: str, plans: Path, tmp_path: Path,
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """One line that names the option, before a browser is asked for."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Chromium, "program", lambda: "absent")
    capsys.readouterr()
    assert run("show", "bottleneck", plans / "cocap.json", *words) == 2
    out, err = capsys.readouterr()
    assert out == "" and said in err and len(err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_film_needs_a_plan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing moves without one."""
    assert run("show", "bottleneck", "-o", tmp_path / "film.webm") == 2
    assert "PLAN: name a plan" in capsys.readouterr().err


def test_what_is_missing_is_said(
    plans: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Without a browser, with the names that are tried; without PyAV, with what needs none."""
    plan, path = plans / "cocap.json", tmp_path / "film.mp4"
    monkeypatch.setattr(Chromium, "program", lambda: None)
    monkeypatch.setattr(film, "find_spec", lambda _: object())
    assert run("show", "bottleneck", plan, "-o", path) == 2
    err = capsys.readouterr().err.splitlines()
    assert len(err) == 1 and all(name in err[0] for name in NAMES)
    monkeypatch.setattr(Chromium, "program", lambda: "chromium")
    monkeypatch.setattr(film, "find_spec", lambda _: None)
    assert run("show", "bottleneck", plan, "-o", path) == 2
    (err,) = capsys.readouterr().err.splitlines()
    assert "pip install 'cocap-opt[film]'; .webp and .gif do not" in err
    assert list(tmp_path.iterdir()) == []
