"""Checks of certificates: the claim of a file is compared with the numbers in it."""

from collections.abc import Callable

import numpy as np

from cocap_opt.files.documents import other_coverage, problem_digest
from cocap_opt.formulations.certificates.format import (
    Certificate,
    CertificateError,
    CertificateFile,
    ProofFile,
    Staged,
    UnfinishedError,
)
from cocap_opt.formulations.certificates.pricing import Pricing
from cocap_opt.model import Model
from cocap_opt.problem import Problem
from cocap_opt.stop import LimitReached, Stop, never
from cocap_opt.text import other_scene

Progress = Callable[[int, int], None]


def verify(
    problem: Problem,
    file: CertificateFile | ProofFile,
    progress: Progress = lambda done, total: None,
    model: Model | None = None,
    stop: Stop = never,
    plain: bool = False,
) -> Pricing:
    """Recomputes the bound of a certificate or a proof from the problem alone.

    Coverage is computed afresh and not taken from a cache.

    Parameters
    ----------
    progress : called with the number of leaves of a proof that are done, or of searches of a staged
        certificate, and the total
    model : of the problem that the bound is for, made without the cache, so that several files
        share its coverage; a model of another problem is not used
    plain : use no code that is compiled by numba; only staged certificates use any, and their
        searches then take about twenty times as long

    Raises
    ------
    CertificateError
        If the file belongs to another scene, is not a tree or not valid, or claims a lower bound
        than its numbers prove.
    UnfinishedError
        If the searches of a staged certificate take too long or a limit is reached; the claim may
        hold all the same.
    """
    problem = file.problem_of(problem)
    if file.digest == problem_digest(problem):
        if model is None or problem_digest(model.problem) != file.digest:
            model = Model(problem, plain=True)
        model = model.disaggregated() if file.classes == "single" else model
        try:
            model.prepare_all(stop)
            if isinstance(file, ProofFile):
                pricing = Pricing.of_proof(model, file, progress, stop)
            else:
                pricing = priced(model, file.certificate, progress, stop, plain)
        except LimitReached as reached:
            raise UnfinishedError(
                f"not verified: the limit ({reached.limit}) was reached before the end; the claim "
                "may hold all the same"
            ) from reached
        if pricing.bound <= file.proved:
            return pricing
        why = f"; {words}" if (words := other_coverage(file.coverage_version)) else ""
        raise CertificateError(
            f"bound: claims {file.proved!r}, but the {file.numbers} prove only "
            f"{pricing.bound!r}{why}"
        )
    which = other_scene(file.scene, problem.name)
    raise CertificateError(f"digest: the {file.kind} was made for {which}")


def priced(
    model: Model,
    certificate: Certificate | Staged,
    progress: Progress = lambda done, total: None,
    stop: Stop = never,
    plain: bool = False,
) -> Pricing:
    """Returns the bound that a certificate proves, in stages or at once."""
    if isinstance(certificate, Staged):
        # So plain certificates are checked without any search.
        from cocap_opt.formulations.certificates.staged import price_staged

        with np.errstate(over="ignore", invalid="ignore"):  # what is infinite is refused
            return price_staged(model, certificate, stop, progress, plain)
    return Pricing.of(model, certificate, stop=stop)
