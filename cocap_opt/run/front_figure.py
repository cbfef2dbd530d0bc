"""The figure of a trade-off between J and views."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure


def draw(
    plans: Sequence[tuple[float, float]], end: float, bound: Callable[[float], float], label: str,
    ax: Axes | None = None,
) -> Axes:  # fmt: skip
    """Draws plans, and the region in which it is proved that there are none.

    Parameters
    ----------
    plans : share of views (%) and J of each plan
    end : share of views (%) that no plan exceeds
    bound : returns the J that no plan of at least a share exceeds
    label : label of the axis of shares
    ax : matplotlib axes (default: those of a new figure)
    """
    if ax is None:
        ax = Figure(figsize=(5.2, 3.6), dpi=100, layout="constrained").add_subplot()
    shares, rewards = [share for share, _ in plans], [reward for _, reward in plans]
    least, top = (min(shares) - 3, max(rewards)) if plans else (0.0, 1.0)
    # J at the beginning of the grey region, if it is near
    highest = bound(min(shares, default=least))
    if top < highest <= 1.5 * top:
        top = highest
    room = max(top - min(rewards, default=0.0), 0.01 * top)
    bottom, roof = top - 1.2 * room, top + 0.3 * room
    ax.set_xlim(least, 100.5)
    ax.set_ylim(bottom, roof)
    grid = np.linspace(least, end, 400).tolist()
    tops = [min(bound(share), roof) for share in grid]
    ax.fill_between(grid, tops, [roof] * len(grid), color="0.88", linewidth=0)
    ax.axvspan(end, 100.5, color="0.88", linewidth=0)
    ax.plot([*grid, end], [*tops, bottom], color="0.4", linewidth=1)
    ax.plot(shares, rewards, "o-", color="C0", markersize=4, linewidth=1, label="plans")
    ax.set_xlabel(label)
    ax.set_ylabel("J (px^0.5/m)")
    ax.text(0.97, 0.95, "proved: no plan here", ha="right", va="top", transform=ax.transAxes)
    ax.legend(loc="lower left", frameon=False)
    return ax
