"""The plans and the proof that the search for a bound begins with, whoever found them."""

import hashlib
from collections.abc import Sequence
from typing import NamedTuple

import msgspec

from cocap_opt.experiments.sweeps.cells import OWN, CellFile
from cocap_opt.files.documents import decode_document, encode
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.problem import Plan


class BoundStart(NamedTuple):
    """The best plans, and the lowest bound that a planner has proved itself."""

    plan: Plan | None = None  # the best of all
    valid: Plan | None = None  # the best of those that obey the rules
    certificate: bytes = b""  # its file's content; empty where there is none
    seconds: float = 0.0  # in which that was proved

    @classmethod
    def of(cls, contents: Sequence[CellFile]) -> "BoundStart":
        """Returns the start that planners' cells give; their names and order do not matter."""
        certificate, seconds = _lowest_bound(contents)
        valid = [content for content in contents if content.row and content.row.valid]
        return BoundStart(_best(contents), _best(valid), certificate, seconds)

    @property
    def proof(self) -> CertificateFile | ProofFile | None:
        """The certificate or the proof of the lowest bound, if there is one."""
        return _decoded(self.certificate, "a planner's proof") if self.certificate else None

    @property
    def digest(self) -> str:
        """Digest of the plans and the proof, on which a bound depends."""
        content = msgspec.json.encode((self.plan, self.valid)) + self.certificate
        return hashlib.sha256(content).hexdigest()


def _decoded(content: bytes, name: str) -> CertificateFile | ProofFile:
    """Returns the certificate or the proof in a file's content."""
    kinds: tuple[type[CertificateFile | ProofFile], ...] = (CertificateFile, ProofFile)
    return decode_document(content, name, *kinds)


def _best(contents: Sequence[CellFile]) -> Plan | None:
    ranked = [
        (-content.row.reward, encode(content.plan.plan), content.plan.plan)
        for content in contents
        if content.plan is not None and content.row is not None and content.row.reward is not None
    ]
    return min(ranked, key=lambda entry: entry[:2])[2] if ranked else None


def _lowest_bound(contents: Sequence[CellFile]) -> tuple[bytes, float]:
    ranked = []
    for content in contents:
        if OWN in content.certificates and content.row is not None:
            own = content.certificate(OWN)
            ranked.append(
                (
                    _decoded(own, content.cell.words).proved,
                    own,
                    content.row.seconds or 0.0,
                )
            )
    return min(ranked)[1:] if ranked else (b"", 0.0)
