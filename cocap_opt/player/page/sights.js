// The views of drones' cameras, up to the first obstacle.

import { unit } from "./geometry.js";
import { isThere } from "./plans.js";

const CLOSER = 0.6; // factor on the length of views in a crowd

// A camera's rays along the edges of its picture, as unit vectors, some per side; a cone looks level.
function rim(drone, [, , , yaw, tilt], perSide) {
  const c = Math.cos(yaw), s = Math.sin(yaw);
  if (drone.rise === null) {
    const parts = Math.max(perSide, Math.ceil(drone.half / 0.1));
    return Array.from({ length: parts + 1 }, (_, k) => drone.half * ((2 * k) / parts - 1))
      .map((angle) => [Math.cos(yaw + angle), Math.sin(yaw + angle), 0]);
  }
  const wide = Math.tan(drone.half), high = Math.tan(drone.rise);
  const corners = [[-wide, -high], [wide, -high], [wide, high], [-wide, high], [-wide, -high]];
  return Array.from({ length: 4 * perSide + 1 }, (_, k) => {
    const side = Math.min(Math.floor(k / perSide), 3), share = k / perSide - side;
    const [across, up] = corners[side].map((v, n) => v + share * (corners[side + 1][n] - v));
    const ahead = Math.cos(tilt) + up * Math.sin(tilt);
    return unit([c * ahead + s * across, s * ahead - c * across, up * Math.cos(tilt) - Math.sin(tilt)]);
  });
}

export class Sights {
  constructor(data, rays, bodies) {
    Object.assign(this, { data, rays, bodies });
  }

  // Views of all drones at a time; if a drone is picked, the others are pale. In a crowd, views are
  // shorter, and only the picked drone's is drawn, if there is one.
  draw(pen, time, reach, { picked, alone }) {
    const { data, bodies } = this, { isCrowd } = bodies, pale = picked === undefined ? 0.085 : 0.03;
    data.drones.forEach((drone, i) => {
      if (!isThere(bodies.plan, i) || ((alone || (isCrowd && picked !== undefined)) && i !== picked)) return;
      const how = i === picked ? { reach, share: 0.1, perSide: 6 }
        : isCrowd ? { reach: CLOSER * reach, share: 0.06, perSide: 2 } : { reach, share: pale, perSide: 6 };
      this.cone(pen, bodies.drone(i, time), drone, bodies.colours[i], how);
    });
  }

  cone(pen, pose, drone, colour, { reach, share, perSide }) {
    const ends = rim(drone, pose, perSide).map((way) => {
      const far = this.rays.length(pose, way, reach);
      return [pose[0] + way[0] * far, pose[1] + way[1] * far, pose[2] + way[2] * far];
    });
    const isLevel = drone.rise === null;
    for (let k = 1; k < ends.length; k++) {
      pen.veil([pose, ends[k - 1], ends[k]], colour, isLevel ? 2 * share : share);
      pen.ray(ends[k - 1], ends[k], colour, 5 * share);
    }
    const corners = isLevel ? [0, ends.length - 1] : [0, 1, 2, 3].map((k) => k * perSide);
    for (const k of corners) pen.ray(pose, ends[k], colour, 5 * share);
  }
}
