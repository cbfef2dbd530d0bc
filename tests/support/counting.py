"""Random problems in which the drones that see people are counted."""

from hypothesis import strategies as st

from cocap_opt.problem import Problem, Views


@st.composite
def counting(draw: st.DrawFn, drawn: st.SearchStrategy[Problem]) -> Problem:
    """Problems as `drawn`, with a weight for drones that see people; pixels may not count."""
    problem = draw(drawn)
    weight = st.sampled_from([0.0, 0.5, 3.0, 20.0])
    people = len(problem.actors)
    views = Views(
        cameras=draw(st.sampled_from([1, 2, 2, 3])),
        weight=draw(st.one_of(weight, st.tuples(*[weight] * people))),
        at_least=draw(st.sampled_from([0.02, 0.3, 0.8, 1.0])),
    )
    pixels = draw(st.sampled_from([1.0, 1.0, 0.0, 0.01]))
    return problem.replace(objective=problem.objective.replace(views=views, pixels=pixels))


def either(drawn: st.SearchStrategy[Problem]) -> st.SearchStrategy[Problem]:
    """Problems as `drawn`, in which people count or do not."""
    return st.one_of(drawn, counting(drawn))
