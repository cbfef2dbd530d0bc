"""The second opinion: networkx and cocap-check find the bound that `verify` finds."""

import math

import numpy as np
import pytest
from counting import either
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from pool import problems
from random_certificates import (
    random_multipliers,
    random_proof,
    random_reference,
    some_model,
)
from strategies import examples, tiny

from cocap_opt.formulations.certificates import (
    CertificateError,
    CertificateFile,
    Pricing,
    ProofFile,
    Staged,
    pricing,
)
from cocap_opt.formulations.column_generation.branch_and_price import column_generation
from cocap_opt.formulations.independent import cocap_check
from cocap_opt.formulations.result import certify
from cocap_opt.formulations.second_opinion import SecondOpinion, TooLargeError, _highest_corner
from cocap_opt.model import Model
from cocap_opt.problem import Problem
from cocap_opt.run.verified import ProvedBound
from cocap_opt.scenarios import load_scene


def assert_same(problem: Problem, file: CertificateFile | ProofFile, swept: Pricing) -> None:
    """Networkx finds the sweep's bound, as nearly as both can say."""
    second = SecondOpinion.of(Model(problem, use_cache=False), file)
    assert second.agrees(swept)
    if math.isfinite(swept.bound):
        near = 1.001 * swept.rounding + 1e-11 * second.magnitude + 1e-300
        assert second.bound == pytest.approx(swept.bound, abs=near)
        wrong = swept._replace(bound=swept.bound + 1e-6 * (1 + second.magnitude))
        assert not second.agrees(wrong)


@examples(8)
@given(problem=either(problems(over_time=True)), seed=st.integers(0, 1000))
def test_networkx_prices_certificates_as_the_sweep_does(problem: Problem, seed: int) -> None:
    """Rows of cells, swaps and moves, cuts, rewards for moves, goals and people in the way."""
    rng = np.random.default_rng(seed)
    model = some_model(problem, rng)
    reference = random_reference(problem, rng)
    for certificate in (random_multipliers(model, rng), reference):
        file = certify(problem, model, "test", certificate)
        assert_same(problem, file, Pricing.of(model, certificate))


@examples(8)
@given(problem=either(problems(over_time=True)), seed=st.integers(0, 1000))
def test_networkx_prices_every_leaf_of_a_proof(problem: Problem, seed: int) -> None:
    """Decisions close, charge or reward what robots use; the worst leaf's bound is the proof's."""
    rng = np.random.default_rng(seed)
    model = some_model(problem, rng)
    proof = random_proof(model, rng)
    assert_same(problem, proof, Pricing.of_proof(model, proof))


def small() -> tuple[Problem, CertificateFile]:
    """The tiny instance with a certificate."""
    problem, rng = tiny(), np.random.default_rng(1)
    model = Model(problem, use_cache=False)
    return problem, certify(problem, model, "test", random_multipliers(model, rng))


def test_a_sweep_that_is_wrong_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """A value that `verify` finds too small would be a false bound: networkx contradicts it."""
    problem, file = small()
    model = Model(problem, use_cache=False)
    proved = ProvedBound.of(model, file, twice=True)
    assert proved.second_opinion is not None
    assert proved.second_opinion.bound == pytest.approx(file.proved, rel=1e-12)
    sweep = pricing.plain_sweep
    monkeypatch.setattr(pricing, "plain_sweep", lambda *args: sweep(*args) * (1 - 1e-6))
    ProvedBound.of(model, file)
    with pytest.raises(CertificateError, match=r"^bound: `verify` finds .*, networkx "):
        ProvedBound.of(model, file, twice=True)


@pytest.mark.parametrize(
    ("limit", "number", "words"),
    [
        ("MOST_EDGES", 5, r"the graph of robots\[0\] has more than 5 edges"),
        ("MOST_WORK", 5, r"networkx would price 291 edges at 1 leaf; the limit is 5 edges"),
        ("MOST_CORNERS", 1, r"a cut has more than 1 corners"),
    ],
)
def test_what_is_too_large_is_refused_in_words(
    limit: str, number: int, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The number that is too large is said, and the largest that is not."""
    problem, file = small()
    _highest_corner.cache_clear()
    monkeypatch.setattr(f"cocap_opt.formulations.second_opinion.{limit}", number)
    with pytest.raises(TooLargeError, match=words):
        ProvedBound.of(Model(problem, use_cache=False), file, twice=True)


@pytest.mark.slow
def test_of_staged_certificates_it_is_that_of_cocap_check(monkeypatch: pytest.MonkeyPatch) -> None:
    """It agrees; a file that it refuses is false, and one that it cannot search is too large."""
    problem = load_scene("corridor-tight", 0)
    file = column_generation(problem).certificate
    assert isinstance(file, CertificateFile) and isinstance(file.certificate, Staged)
    proved = ProvedBound.of(Model(problem), file, twice=True)
    assert proved.second_opinion is not None and proved.second_opinion.by == "cocap-check"
    assert proved.second_opinion.bound == pytest.approx(file.proved, rel=1e-9)
    with monkeypatch.context() as patch:
        patch.setattr(cocap_check, "MOST_BRANCHES", 1)
        with pytest.raises(TooLargeError, match="more than 1 branches"):
            SecondOpinion.of(Model(problem), file)
    higher = proved.pricing._replace(bound=proved.pricing.bound * (1 + 1e-6))
    assert proved.second_opinion.agrees(higher)  # it may prove more than `verify`
    other = replace(file, instance="0" * 64)
    with pytest.raises(CertificateError, match="rejected by cocap-check: instance: "):
        SecondOpinion.of(Model(problem), other)
    wrong = replace(file.certificate, target=math.inf)
    with pytest.raises(CertificateError, match="rejected by cocap-check"):
        SecondOpinion.of(Model(problem), replace(file, certificate=wrong))
