"""From a plan to a flight: where each drone is at every moment, and whether it can fly so.

`trajectory` has the flights, straight from step to step or `smooth`; `safety` checks them against
the scene at every moment, on the polynomials themselves, and says when drones are nearest to each
other and to people; `rests` has flights that rest at steps, of which it is known before that they
are safe; `pace` checks them against the drones' limits; `strain` says what any smooth
flight may ask; `filming` computes J between the steps, too; `footprint` gives the ground in the
images; `earth` gives latitudes and longitudes; `delays` says how far drones may be apart in time,
`robustness` what becomes of a flight that is not as planned. `bernstein` has the polynomials of
them all. `flights` puts them together: the `Flight` of a plan, checked for being flown, in the
scene that `flight_scene` makes of a problem; `changes` has a row for each change it meets.
`ways` leads drones from home to the first places and back, and counts their batteries;
`touchdowns` warns of roofs, obstacles and water on which they take off or land, and of drones that
are too close to each other as they do; `urgent` has all warnings that nobody must overlook.
`notes` has the kinds of sentences on a flight.
"""
