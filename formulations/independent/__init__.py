"""An independent checker: instances without geometry, and one file that checks proofs.

`instance` writes all that a bound needs of a scene as text: who can fly where, what is seen from
there and what it is worth. `cocap_check` reads that text, a plan and a certificate or a proof, and
says what they prove, by whole numbers alone. It imports nothing but the standard library, and so
nothing of this project either: copy the file, read it, and run it anywhere.
"""

from cocap_opt.formulations.independent.instance import instance_digest, instance_of

__all__ = ["instance_digest", "instance_of"]
