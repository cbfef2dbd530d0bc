"""Mixtures for tests: raised step by step, as column generation begins."""

from collections.abc import Iterator

from cocap_opt.formulations.column_generation.master.pricing import Priced
from cocap_opt.formulations.column_generation.parameters import DEFAULTS
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.mixtures.mixture_ascent import mixture_ascent
from cocap_opt.stop import never


def raised_mixtures(search: Search) -> Iterator[tuple[Mixture, float, Priced]]:
    """Better and better mixtures of a search's model, each with its value and its pricing."""
    of_prices, parameters = search.pricer.of_prices, DEFAULTS.ascent
    return mixture_ascent(search.model, of_prices, search.alone, never, parameters)
