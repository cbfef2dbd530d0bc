"""Quality of a plan: how many drones see each person, from how far apart, and how accurately.

`poses` has the positions and axes of a plan's cameras, and the rays from them to people; `shares`
the visible share of each person in the images. `rays` computes the angles between rays; `accuracy`
the error of a point triangulated from them, by the derivatives of the projection; `blur` how far
people move in an image during the exposure; `intruders` which drones are in each other's images.
`moments` names the worst moments in words, `summary` has shares and errors of all people and of
each. `quality` combines them into the `Quality` of a plan, under `assumptions`; `words` describes
it and `strip` draws it. `losses` computes the rest of a flight after a drone is lost. Of these, the
objective can include only the count of drones that see people (`Views`); everything else is
measured afterwards.
"""
