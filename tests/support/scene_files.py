"""Texts of small scene files of other projects, which tests write, read and damage."""

# A seq.yaml of Greedy Perspectives: two robots and one actor on 6 x 4 cells, two moves.
SEQUENCE = """\
planner:
  world:
    time: {horizon: 3, stepSize: 0.3}
    state_resolution: {heading: 8, gridSize: 1}
    map: {file: elsewhere/tiny/map.npy, gridSize: 1}
    actors:
      - actor:
          geometry: {width: 9, length: 9, height: 9}
          trajectory: [[2, 3.5, 0], [3, 3.5, 0.1], [4, 3.5, 0.2], [5, 3.5, 0.3]]
    agents:
      - agent:
          startPose: [1.5, 0, 5, 0]
          camera: {intrinsics: [2500, 4000, 3000], tilt: 1.4}
      - agent:
          startPose: [4, 1, 6, -1]
          camera: {intrinsics: [1000, 400, 300], tilt: 1.2}
"""
STARTS = "x,y,z,theta\n0,0,5,0\n1,0,5,0\n0,1 ,5,3.1415\n1,1,5,3.4\n"

# A seq.yaml of one robot and one actor on 4 x 4 cells, one move.
SMALL_SEQUENCE = """\
planner:
  world:
    time: {horizon: 2}
    state_resolution: {heading: 8}
    map: {file: map.npy, gridSize: 1}
    actors: [{actor: {trajectory: [[2, 3.5, 0], [3, 3.5, 0]]}}]
    agents:
      - agent: {startPose: [1.5, 0, 5, 0], camera: {intrinsics: [2500, 4000, 3000], tilt: 1}}
"""
