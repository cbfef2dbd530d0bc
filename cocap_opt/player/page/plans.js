// Facts of a plan, and its state at a time.

import { NOBODY } from "./colours.js";
import { TAU } from "./geometry.js";

// A row between the rows of two steps; column 3 is an angle.
export function between(rows, time) {
  const t = Math.min(Math.floor(time), rows.length - 1), share = t < rows.length - 1 ? time - t : 0;
  if (!share) return rows[t];
  return rows[t].map((a, i) => {
    const way = rows[t + 1][i] - a;
    return a + share * (i === 3 ? way - TAU * Math.round(way / TAU) : way);
  });
}

// True if no drone of a plan leaves its place.
export const isStill = ({ paths }) => paths.every(([start, ...rest]) =>
  rest.every((pose) => [0, 1, 2].every((k) => pose[k] === start[k])));

// True if a drone has a path; a drone whose start is not yet chosen has none.
export const isThere = ({ paths }, drone) => paths[drone].length > 0;

// True for so many drones or people that they cannot all have a colour and a number in pictures.
const CROWD = 14;
export const isCrowd = (some) => some.length > CROWD;

// The colour of a drone: its own, or in a crowd the colour of the people whom it films most.
export const colourOf = (data, plan, drone) => (isCrowd(data.drones)
  ? data.tasks[plan.tasks[drone]]?.colour ?? NOBODY : data.drones[drone].colour);

// The numbers of the drones that have paths.
export const present = (plan) => plan.paths.map((_, i) => i).filter((i) => isThere(plan, i));

// True if some drone moves, or turns its camera.
export const turns = ({ paths }) => paths.some(([start, ...rest]) => rest.some((pose) => pose.some((value, k) => value !== start[k])));

// The height (m) of a drone at a step; a constant height is stored once.
export const heightOf = ({ heights }, drone, step) => heights[drone][step] ?? heights[drone][0];

// Conflicts at a time: conflicts in a cell around their step, swaps from one step to the next.
export function conflictsAt(plan, time) {
  return plan.conflicts.filter(({ step, between }) =>
    between ? time >= step && time <= step + 1 : Math.round(time) === step);
}

export const nearAt = (plan, time) => plan.near.filter((one) => Math.abs(one.time - time) < 0.3);
