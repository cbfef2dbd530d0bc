"""The relaxation over paths: columns, mixtures, the restricted master problem, pricing.

A mixture (`mixture`) weights single-robot paths (`columns`). The master problem (`master`, its
conic program in `master_program`) finds the best mixture of the known columns, `pricing` finds
better columns, and `mixture_ascent` finds the first ones, without a master. `alike_cuts` finds
envelope cuts for many robots of one class.
"""
