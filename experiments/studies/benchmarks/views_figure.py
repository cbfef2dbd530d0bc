"""The figure of errors of planned coverage against what it costs."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cocap_opt.experiments.report.figures import draw_frame
from cocap_opt.experiments.results.rows import Row

COLOURS = ("#30638e", "#d1495b", "#edae49", "#4c956c", "#6a4c93")
PARTS = {
    "clear": "faces in full view: 99 % have a smaller error",
    "hidden": "faces partly hidden: half have a smaller error",
}
KEYS = {"clear": "clear, 99 % error (%)", "hidden": "hidden, median error (%)"}


def views_figure(rows: Sequence[Row]) -> Figure:
    """Errors against seconds of coverage, a panel for faces in full view and for hidden ones."""
    figure = Figure(figsize=(9, 3.8), layout="constrained", dpi=130)
    for ax, part in zip(figure.subplots(1, 2), PARTS, strict=True):
        draw_errors(ax, rows, KEYS[part])
        ax.set_title(PARTS[part], fontsize=10)
    figure.suptitle(
        "Planned against rendered pixels; numbers: samples along a triangle", fontsize=11
    )
    return figure


def draw_errors(ax: Axes, rows: Sequence[Row], key: str) -> Axes:
    """A line per scene, a point per number of samples."""
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    for scene, colour in zip(scenes, COLOURS, strict=False):
        own = [row for row in rows if row["scene"] == scene and row[key] is not None]
        ax.plot([row["seconds"] for row in own], [row[key] for row in own], marker="o", ms=4,
                color=colour, label=scene)  # fmt: skip
        for row in own:
            ax.annotate(str(row["samples"]), (row["seconds"], row[key]), fontsize=7,
                        xytext=(3, 3), textcoords="offset points", color=colour)  # fmt: skip
    ax.set_xlim(left=0)
    ax.set_ylim(bottom=0)
    ax.set_xlabel("coverage of the whole scene (s)")
    ax.set_ylabel("error (%)")
    ax.grid(True, lw=0.4, alpha=0.5)
    draw_frame(ax)
    ax.legend(fontsize=8, frameon=False)
    return ax
