"""The relaxation over paths: the restricted master problem, pricing, and the cuts and rows between.

`master` finds the best mixture of the known paths, by the conic program of `master_program`, whose
flow `flow_paths` splits into paths; `pricing` finds better paths. `resource_use` finds the rules
that a mixture violates and the resource to branch on, `arc_users` the arcs that use a resource.
For very many robots, `ruled_program` replaces the master, `alike_cuts` finds envelope cuts for many
robots of one class, and `state_cuts` (compiled in `state_cut_kernel`) those of single states.
"""
