"""Second opinions on verified bounds; an unfinished one does not affect its bound."""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import NamedTuple

from cocap_opt.console.progress import Watch
from cocap_opt.formulations import second_opinion
from cocap_opt.formulations.certificates import CertificateError, CertificateFile, ProofFile
from cocap_opt.formulations.second_opinion import TooLargeError
from cocap_opt.output.printing import Record
from cocap_opt.problem import Problem
from cocap_opt.run.judged import finite
from cocap_opt.run.options import UsageError
from cocap_opt.run.verified import ProvedBound, Verified


def require_small(problem: Problem, files: Iterable[CertificateFile | ProofFile]) -> None:
    """Rejects bounds that are too large for a second opinion, before any of them is checked.

    Raises
    ------
    UsageError
        If one is too large.
    """
    for file in files:
        try:
            with suppress(CertificateError):  # the check itself reports these errors
                second_opinion.require_small(file.problem_of(problem), file)
        except TooLargeError as error:
            raise _too_large(error) from error


class Opinions(NamedTuple):
    """Verified bounds, with the second opinions found.

    Attributes
    ----------
    bounds : the bounds, except those that a second opinion contradicts
    failed : the contradictions, in words
    missing : the files whose requested second opinion is missing
    reason : why they are missing: Ctrl-C, or the search found that the first file is too large
    """

    bounds: tuple[ProvedBound, ...]
    failed: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    reason: KeyboardInterrupt | TooLargeError | None = None

    @classmethod
    def of(cls, bounds: Mapping[str, ProvedBound]) -> "Opinions":
        """Computes the second opinions; unfinished ones do not affect the bounds.

        Parameters
        ----------
        bounds : bounds by the names of their files
        """
        found, failed = dict(bounds), list[str]()
        for n, (name, bound) in enumerate(bounds.items()):
            try:
                with Watch.on_terminal(name) as watch:
                    found[name] = bound.found_twice(watch.counter("second opinion"))
            except CertificateError as error:
                del found[name]
                failed.append(f"{name}: {error}")
            except (KeyboardInterrupt, TooLargeError) as reason:
                missing = tuple(bounds)[n:]
                return cls(tuple(found.values()), tuple(failed), missing, reason)
        return cls(tuple(found.values()), tuple(failed))

    def answer(self, verified: Verified) -> Record:
        """Returns the second opinion on the lowest bound, as `verify` prints it."""
        if verified.proved is None:
            return {}
        if second := verified.proved.second_opinion:
            return {
                "bound_by_verify": finite(verified.proved.pricing.bound),
                "second_bound": finite(second.bound),
                "second_opinion": second.by,
            }
        if self.reason is None:
            return {}
        is_interrupt = isinstance(self.reason, KeyboardInterrupt)
        return {"second_opinion": "interrupted" if is_interrupt else "none, too large"}

    def require_all(self) -> None:
        """Raises an error according to `reason` if second opinions are missing.

        Raises
        ------
        KeyboardInterrupt
            If Ctrl-C ended the computation; the message names the files.
        UsageError
            If a file is too large for a second opinion.
        """
        if isinstance(self.reason, KeyboardInterrupt):
            raise KeyboardInterrupt(f"no second opinion on {', '.join(self.missing)}")
        if self.reason is not None:
            raise _too_large(self.reason) from self.reason


def _too_large(error: TooLargeError) -> UsageError:
    return UsageError(f"--second-opinion: {error}")
