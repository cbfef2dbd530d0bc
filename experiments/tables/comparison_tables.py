"""Tables of planners compared over scenes: paired tests, and performance profiles."""

from collections.abc import Iterable, Sequence

from cocap_opt.experiments.tables.comparison import (
    ENOUGH,
    SECONDS,
    J,
    PairedTest,
    Profile,
    paired_tests,
    profiles,
)
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.statistics import Mean
from cocap_opt.experiments.tables.tables import Table, Tables
from cocap_opt.output.printing import Record
from cocap_opt.text import counted

_SHOWN = {J: (1.0, 1.001, 1.01, 1.05, 1.1), SECONDS: (1.0, 2.0, 5.0, 10.0, 100.0)}
_LEAST = 1e-4  # smaller p are shown as less than this
_WORDS = {J: ("higher", "lower"), SECONDS: ("slower", "faster")}
_TEST = (
    "Median difference: over scenes, in % of the larger one. p: two-sided, as if this were the "
    "only test; p (Holm): corrected for the number of tests."
)
_TEST_NOTES = {
    J: "Higher, equal, lower: number of scenes on which the planner's mean J compares like this "
    f"with the other planner's. A run without a valid plan counts as J = 0. {_TEST}",
    SECONDS: "Slower, equal, faster: number of scenes on which the planner's mean time compares "
    "like this with the other planner's. A run without a valid plan counts as its whole time "
    f"limit, unless it proves that there is none. {_TEST}",
}
_SHARE = (
    "the seeds of a scene share its weight equally. Only scenes and seeds on which all planners "
    "were run and at least one found a valid plan count."
)
_PROFILE_NOTES = {
    J: f"Share of scenes on which J is this close to the best planner's; {_SHARE}",
    SECONDS: f"Share of scenes on which the time is this close to the fastest planner's; {_SHARE}",
}


def comparison_tables(rows: Sequence[GapRow], against: str | None = None) -> Tables:
    """Returns the tables of `table --compare`; their titles name the test and its correction.

    Parameters
    ----------
    against : the planner to compare all others with; None: all pairs are compared
    """
    tests, drawn = paired_tests(rows, against), profiles(rows)
    found: dict[str, Table] = {}
    notes: dict[str, str] = {}
    for measure in (J, SECONDS):
        of_measure = [test for test in tests if test.measure == measure]
        title = (
            f"Paired tests of {measure} over scenes (Wilcoxon signed-rank, p by Holm over "
            f"{counted(len(of_measure), 'test')})"
        )
        found[title] = [_of_test(test) for test in of_measure]
        notes[title] = _TEST_NOTES[measure]
    for measure in (J, SECONDS):
        title = f"Performance profiles of {measure} (% of scenes)"
        found[title] = [_of_profile(profile) for profile in drawn if profile.measure == measure]
        notes[title] = _PROFILE_NOTES[measure]
    return Tables({title: table for title, table in found.items() if table}, notes)


def too_few_scenes(rows: Sequence[GapRow]) -> str:
    """Returns a warning if there are too few scenes for a test, otherwise an empty string."""
    n = len({row.scene for row in rows})
    if n >= ENOUGH:
        return ""
    return (
        f"{counted(n, 'scene')}: a paired test over fewer than {ENOUGH} scenes cannot have "
        "p < 0.05, however much the planners differ"
    )


def test_records(tests: Iterable[PairedTest]) -> list[Record]:
    """Returns tests as rows of numbers, for CSV."""
    return [
        {
            "measure": test.measure, "planner": test.planner, "against": test.against,
            "scenes": test.scenes, "above": test.above, "equal": test.equal, "below": test.below,
            "median_difference": test.median, "p_wilcoxon": test.p, "p_holm": test.corrected,
        }
        for test in tests
    ]  # fmt: skip


def profile_records(drawn: Iterable[Profile]) -> list[Record]:
    """Returns the points at which profiles rise as rows of numbers, for CSV."""
    return [
        {"measure": profile.measure, "planner": profile.planner, "ratio": ratio, "share": share}
        for profile in drawn
        for ratio, share in zip(profile.ratios, profile.shares, strict=True)
    ]


def _of_test(test: PairedTest) -> dict[str, str]:
    above, below = _WORDS[test.measure]
    return {
        "planner": test.planner,
        "against": test.against,
        "median difference (%)": Mean.rounded(100 * test.median, 3),
        above: str(test.above),
        "equal": str(test.equal),
        below: str(test.below),
        "scenes": str(test.scenes),
        "p": _p(test.p),
        "p (Holm)": _p(test.corrected),
    }


def _of_profile(profile: Profile) -> dict[str, str]:
    shares = {_within(r, profile.measure): 100 * profile.share(r) for r in _SHOWN[profile.measure]}
    return {
        "planner": profile.planner,
        **{words: Mean.rounded(share, 0) for words, share in shares.items()},
    }


def _within(ratio: float, measure: str) -> str:
    """Returns a column's heading for a factor from the best, e.g. "within 5 %"."""
    if ratio == 1:
        return "the best"
    return f"within {100 * (ratio - 1):.3g} %" if measure == J else f"within {ratio:g} times"


def _p(value: float) -> str:
    return f"< {_LEAST:g}" if value < _LEAST else f"{value:.4f}"
