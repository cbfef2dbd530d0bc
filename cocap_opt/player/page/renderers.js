// What draws the pictures of a page: a graphics card where there is one, else the processor. A page that
// is opened with `?renderer=raster` or `?renderer=webgl` has no choice.

import { openGpu } from "./gpu.js";
import { GpuRaster } from "./gpu_raster.js";
import { Raster } from "./raster.js";

const asked = new URLSearchParams(window.location.search).get("renderer");
const gpu = asked === "raster" ? undefined : openGpu(asked === "webgl");

// What draws, by its name.
export const renderer = () => (gpu && !gpu.isLost ? "webgl" : "raster");

export const onLoss = (act) => gpu?.gl.canvas.addEventListener("webglcontextlost", act);

// An empty picture. `through`: how much is seen of what moves through what is solid.
export const newRaster = (through) => (renderer() === "webgl" ? new GpuRaster(gpu, through) : new Raster(through));
