"""The style of figures, which notebooks take as a style sheet of matplotlib."""

from matplotlib import colors, style

from cocap_opt.pictures.style import LABEL, SERIES, TITLE, WIDTH


def test_the_style_sheet_has_colours_and_sizes_of_all_figures() -> None:
    """Notebooks look like the pages around them."""
    with style.context("cocap_opt.pictures.house"):
        from matplotlib import rcParams

        cycle = [colors.to_hex(look["color"]) for look in rcParams["axes.prop_cycle"]]
        assert cycle == list(SERIES)
        assert rcParams["figure.figsize"][0] == WIDTH
        assert (rcParams["axes.titlesize"], rcParams["axes.labelsize"]) == (TITLE, LABEL)
        assert rcParams["legend.fontsize"] == rcParams["ytick.labelsize"] == LABEL
