"""Checks certificates: compares the claim of a file with the bound that its numbers prove."""

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

    Coverage is recomputed, not taken from a cache.

    Parameters
    ----------
    progress : called with the number of finished leaves of a proof, or finished searches of a
        staged certificate, and the total
    model : model of the bound's problem, made without the cache, so that several files can share
        its coverage; a model of another problem is ignored
    plain : True: use no code compiled by numba. Only searches of staged certificates use such code;
        without it they take about twenty times as long

    Raises
    ------
    CertificateError
        If the file belongs to another scene, is not valid, has nodes that do not form a tree, or
        claims a lower bound than its numbers prove.
    UnfinishedError
        If the searches of a staged certificate take too long or a limit is reached; the claim may
        still hold.
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
                f"not verified: the limit ({reached.limit}) was reached before the end; the "
                "claim may still hold"
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
    """Returns the bound that a certificate proves, whether staged or plain."""
    if isinstance(certificate, Staged):
        # Imported here, so that plain certificates are checked without loading any search.
        from cocap_opt.formulations.certificates.staged import price_staged

        with np.errstate(over="ignore", invalid="ignore"):  # infinite values are rejected
            return price_staged(model, certificate, stop, progress, plain)
    return Pricing.of(model, certificate, stop=stop)
