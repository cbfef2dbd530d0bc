"""From a plan to a flight: the position of each drone at every moment, and whether it can be flown.

`trajectory` has the flights, straight from step to step or `smooth`; `safety` checks them against
the scene at every moment, on the polynomials themselves, and finds when drones are nearest to each
other and to people; `rests` has flights that rest at steps, which are safe by construction; `pace`
checks them against the drones' limits; `strain` bounds the demands of any smooth flight; `filming`
computes J between the steps, too; `footprint` gives the ground in the images; `earth` gives
latitudes and longitudes; `delays` computes tolerable delays, `robustness` the outcome of flights
that deviate from the plan. `bernstein` has the polynomials that all of them use. `flights` combines
these: the `Flight` of a plan, checked before it is flown, in the scene that `flight_scene` makes of
a problem; `changes` has a row for each deviation. `ways` leads drones from home to their first
places and back, and computes their flight times; `touchdowns` warns of roofs, obstacles and water
on which they take off or land, and of drones that are too close to each other as they do; `urgent`
collects the warnings that nobody may overlook. `notes` has the kinds of notes on a flight.
"""
