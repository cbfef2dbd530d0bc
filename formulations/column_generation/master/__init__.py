"""The relaxation over paths: columns, mixtures, the restricted master problem, pricing.

A mixture (`mixture`) weighs single-robot paths (`columns`). The master problem (`master`, its
conic program in `master_program`) finds the best one of the columns that are known, `pricing` finds
better columns, and `mixture_ascent` the first ones, without a master. `alike_cuts` finds envelope
cuts of many robots of one class.
"""
