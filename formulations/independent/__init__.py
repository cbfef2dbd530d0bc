"""An independent checker: instances without geometry, and what holds them to proofs and scenes.

`instance` writes all that a bound needs of a scene as text: who can fly where, what is seen from
there and what it is worth. `cocap_check` reads that text, a plan and a certificate or a proof, and
says what they prove, by whole numbers alone. It imports nothing but the standard library, and so
nothing of this project either: copy the file, read it, and run it anywhere.

`audit` asks if an instance is its scene's. It shares nothing with `instance`, and reads two texts:
`instance_facts` the instance, `scene_facts` the scene's JSON, from which it finds anew who can fly
where, by networkx. `differences` tells what parts them; `enclosures` finds by interval arithmetic
between which numbers coverage lies.
"""

from cocap_opt.formulations.independent.instance import instance_digest, instance_of

__all__ = ["instance_digest", "instance_of"]
