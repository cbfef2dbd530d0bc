// What a plan has, and where it is at a time.

import { NOBODY } from "./colours.js";
import { TAU } from "./geometry.js";

// A row between two steps; column 3 is an angle.
export function between(rows, time) {
  const t = Math.min(Math.floor(time), rows.length - 1), share = t < rows.length - 1 ? time - t : 0;
  if (!share) return rows[t];
  return rows[t].map((a, i) => {
    const way = rows[t + 1][i] - a;
    return a + share * (i === 3 ? way - TAU * Math.round(way / TAU) : way);
  });
}

// Whether no drone of a plan leaves its place.
export const isStill = ({ paths }) => paths.every(([start, ...rest]) =>
  rest.every((pose) => [0, 1, 2].every((k) => pose[k] === start[k])));

// True if a drone is there: one whose start is still to be chosen has no path.
export const isThere = ({ paths }, drone) => paths[drone].length > 0;

// True of so many drones, or people, that they cannot all have a colour and a number in pictures.
const CROWD = 14;
export const isCrowd = (some) => some.length > CROWD;

// The colour of a drone: its own, in a crowd that of the people whom it films most.
export const colourOf = (data, plan, drone) => (isCrowd(data.drones)
  ? data.tasks[plan.tasks[drone]]?.colour ?? NOBODY : data.drones[drone].colour);

// The numbers of the drones that are there.
export const present = (plan) => plan.paths.map((_, i) => i).filter((i) => isThere(plan, i));

// True if some drone moves, or turns its camera.
export const turns = ({ paths }) => paths.some(([start, ...rest]) => rest.some((pose) => pose.some((value, k) => value !== start[k])));

// Flight height of a drone (m), of which there is only one where it is always the same.
export const heightOf = ({ heights }, drone, step) => heights[drone][step] ?? heights[drone][0];

// Conflicts at a time: in a cell around the step, in a swap from one step to the next.
export function conflictsAt(plan, time) {
  return plan.conflicts.filter(({ step, between }) =>
    between ? time >= step && time <= step + 1 : Math.round(time) === step);
}

export const nearAt = (plan, time) => plan.near.filter((one) => Math.abs(one.time - time) < 0.3);
