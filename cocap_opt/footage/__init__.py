"""Quality of a plan: how many drones see each person, from how far apart, and how accurately.

`poses` has the places and axes of a plan's cameras, and the rays from them to people; `shares` what
is visible of these in the pictures. `rays` says how far apart rays are; `accuracy` what error a
point has that is triangulated from them, by the projection's derivatives; `blur` how far people
move in the picture while it is taken; `intruders` which drones are in each other's pictures.
`moments` names the worst moments in words, `summary` has shares and errors of all people and of
each. `quality` puts them together: the `Quality` of a plan, under `assumptions`, which `words`
tells and `strip` draws. `losses` tells what is left of a flight when a drone is lost on the way. Of
the quality, the objective may count the drones that see people (`Views`); all else is measured
afterwards.
"""
