"""An independent checker: instances without geometry, and audits of instances, scenes and proofs.

`instance` writes as text all facts of a scene on which a bound depends: who can fly where, what is
seen from there, and how much it is worth. `cocap_check` reads that text, a plan and a certificate
or a proof, and computes what they prove, in integer arithmetic only. It imports only the standard
library, and therefore nothing of this project: copy the file, read it, and run it anywhere.

`audit` checks whether an instance matches its scene. It shares no code with `instance`, and reads
two texts: `instance_facts` reads the instance, `scene_facts` reads the scene's JSON, from which it
recomputes with networkx who can fly where. `differences` describes the differences between the two;
`enclosures` bounds coverage from below and above by interval arithmetic.
"""

from cocap_opt.formulations.independent.instance import instance_digest, instance_of

__all__ = ["instance_digest", "instance_of"]
