// The renderer of a page's pictures: a graphics card if there is one, else the processor. A page that
// is opened with `?renderer=raster` or `?renderer=webgl` uses that one.

import { openGpu } from "./gpu.js";
import { GpuRaster } from "./gpu_raster.js";
import { Raster } from "./raster.js";

const asked = new URLSearchParams(window.location.search).get("renderer");
const gpu = asked === "raster" ? undefined : openGpu(asked === "webgl");

// The name of the renderer.
export const renderer = () => (gpu && !gpu.isLost ? "webgl" : "raster");

export const onLoss = (act) => gpu?.gl.canvas.addEventListener("webglcontextlost", act);

// An empty picture. `through`: how visible moving things are through solid ones.
export const newRaster = (through) => (renderer() === "webgl" ? new GpuRaster(gpu, through) : new Raster(through));
