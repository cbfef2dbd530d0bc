"""Bounds and exact optima. A new method needs one file and one line in a registry below.

This module imports nothing from its package, so importing the certificates loads no method.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from cocap_opt.method import START_AND_REPORT, Method

if TYPE_CHECKING:
    from cocap_opt.formulations.result import CertifiedResult

__all__ = ["BOUNDS", "EXACT"]


def _bound(call: str, made_of: str, scenes: str, promises: str = "") -> "Method[CertifiedResult]":
    return Method(
        f"cocap_opt.formulations.{call}",
        made_of,
        f"a certified bound {promises}".strip(),
        scenes,
        START_AND_REPORT,
        bounds=True,
        certified=True,
    )


def _exact(
    call: str, made_of: str, scenes: str, promises: str, certified: bool = True
) -> "Method[CertifiedResult]":
    return Method(
        f"cocap_opt.formulations.{call}",
        made_of,
        promises,
        scenes,
        START_AND_REPORT | {"gap"},
        bounds=True,
        obeys_rules=True,
        complete=True,
        optimal=True,
        certified=certified,
    )


_ANY, _FEW, _TINY = "any size", "a few steps", "tiny scenes"
_BY_ITS_WORD = "the optimum, certified as far as a relaxation's bound goes"
_INTEGER = "an integer program, refined until its plan's true J meets the bound, with"

BOUNDS: "Mapping[str, Method[CertifiedResult]]" = MappingProxyType(
    {
        "alone": _bound(
            "simple_bounds:alone", ("sum over drones of what each could achieve alone"), _ANY
        ),
        "online": _bound(
            "simple_bounds:online",
            ("J of a plan plus the most that each drone could add to it"),
            _ANY,
        ),
        "concave": _bound(
            "relaxations.cone_program:concave", "concave relaxation over the aggregated flow", _FEW
        ),
        "single-view": _bound(
            "relaxations.cone_program:single_view",
            "concave relaxation with single-view cuts",
            _FEW,
        ),
        "envelope": _bound(
            "relaxations.cone_program:envelope", "concave relaxation with envelope cuts", _FEW
        ),
        "column-generation": _bound(
            "column_generation.branch_and_price:column_generation",
            "relaxation over paths with all cuts and step envelopes",
            _ANY,
            "and a plan",
        ),
    }
)

EXACT: "Mapping[str, Method[CertifiedResult]]" = MappingProxyType(
    {
        "brute-force": _exact(
            "brute_force:brute_force",
            "all plans, one by one",
            _TINY,
            "the optimum, without a certificate",
            certified=False,
        ),
        "branch-and-price": _exact(
            "column_generation.branch_and_price:branch_and_price",
            "a tree over column generation",
            _ANY,
            "the optimum, with a proof",
        ),
        "searchless": _exact(
            "column_generation.branch_and_price:searchless",
            "branch-and-price that branches only, without joint states",
            "small scenes",
            "the optimum, with a proof that can be checked without a search",
        ),
        "highs": _exact("integer_programs.mathopt:highs", f"{_INTEGER} HiGHS", _FEW, _BY_ITS_WORD),
        "scip": _exact("integer_programs.mathopt:scip", f"{_INTEGER} SCIP", _FEW, _BY_ITS_WORD),
        "cp-sat": _exact(
            "integer_programs.cp_sat:cp_sat", f"{_INTEGER} CP-SAT", _FEW, _BY_ITS_WORD
        ),
        "scip-nonlinear": _exact(
            "integer_programs.scip_nonlinear:scip_nonlinear",
            "nonlinear integer program with SCIP; needs PySCIPOpt",
            _FEW,
            _BY_ITS_WORD,
        ),
    }
)
