// Draws the same pictures as the raster, with the same methods, on a graphics card.

import { Batch } from "./gpu.js";
import { WALL } from "./light.js";
import { LINE, lineOf } from "./raster.js";

const PLAIN = 0, LIT = 1, WALLED = 2; // kinds of light
// Share of all depths by which a backdrop is in front of the empty background
const CLOSER = 1e-6;

export class GpuRaster {
  // `through`: how visible moving things are through solid ones.
  constructor(gpu, through) {
    Object.assign(this, { gpu, through, width: 0, height: 0, targets: [], line: new Float64Array(12) });
    [this.stills, this.tints, this.moves, this.veils] = Array.from({ length: 4 }, () => new Batch());
    [this.ground, this.shift] = [WALL, 0]; // the light on the ground
  }

  get isLost() {
    return this.gpu.isLost;
  }

  resize(width, height) {
    if (width === this.width && height === this.height) return false;
    Object.assign(this, { width, height });
    this.targets.forEach((target) => this.gpu.release(target));
    this.targets = [true, true, false].map((hasDepth) => this.gpu.target(width, height, hasDepth));
    return true;
  }

  // The smallest and the largest w.
  reach(far, near) {
    this.depths = [far, near - far];
  }

  clear(colour) {
    this.paper = [colour & 255, (colour >> 8) & 255, (colour >> 16) & 255].map((v) => v / 255);
    this.stills.clear();
    this.tints.clear();
    this.isStale = true;
  }

  // Fill the background, behind all static things, with a colour for each row.
  backdrop(colourOf) {
    const { width, height, depths: [far, deep] } = this, w = far + CLOSER * deep;
    for (let y = 0; y < height; y++) {
      this.stills.add([0, y, w, width, y, w, width, y + 1, w, 0, y + 1, w], 4, colourOf(y), PLAIN, nothing);
    }
  }

  begin() {
    this.moves.clear();
    this.veils.clear();
  }

  fillStill(p, n, colour, shade) {
    if (!shade) return this.stills.add(p, n, colour, PLAIN, nothing);
    const isWall = shade.map === WALL.map;
    if (!isWall) this.ground = shade;
    this.shift = shade.shift;
    this.stills.add(p, n, colour, isWall ? WALLED : LIT, (into, at, x, y) => shade.parts(into, at, x - 0.5, y - 0.5));
  }

  tintStill(p, n, colour, share) {
    this.tints.add(p, n, seeThrough(colour, share), PLAIN, nothing);
  }

  fillMoving(p, n, colour) {
    this.moves.add(p, n, colour, PLAIN, nothing);
  }

  compose() {}

  blend(p, n, colour, share, { aside = false, hatch = 0 } = {}) {
    this.veils.add(p, n, seeThrough(colour, share), PLAIN, (into, at) => {
      into[at] = Number(aside);
      into[at + 1] = hatch;
      into[at + 2] = hatch * LINE;
    });
  }

  stroke(p, i, j, thickness, lift) {
    return lineOf(this.line, p, i, j, thickness, lift);
  }

  finish(context) {
    const { gpu, gpu: { gl }, width, height, targets: [still, moving, out] } = this;
    gl.viewport(0, 0, width, height);
    if (this.isStale) this.drawStill(still);
    this.isStale = false;
    this.into(moving, [0, 0, 0]);
    this.solids(this.moves);
    gl.bindFramebuffer(gl.FRAMEBUFFER, out.frame);
    gl.disable(gl.DEPTH_TEST);
    const depths = { stillDepth: still.depth, movingDepth: moving.depth };
    gpu.use(gpu.merged, { stillColour: still.colour, movingColour: moving.colour, ...depths }, { through: this.through });
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    this.clears(this.veils, depths, 0);
    this.show(context, out);
  }

  drawStill(still) {
    this.into(still, this.paper);
    this.solids(this.stills);
    // Tinted things are compared with depths that are complete.
    const { gl } = this.gpu;
    gl.disable(gl.DEPTH_TEST);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, null, 0);
    this.clears(this.tints, { stillDepth: still.depth, movingDepth: still.depth }, 1);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, still.depth, 0);
  }

  // Starts drawing into a texture.
  into({ frame }, [red, green, blue]) {
    const { gl } = this.gpu;
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LESS);
    gl.clearColor(red, green, blue, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  }

  solids(batch) {
    const { gpu, ground, shift, width, height, depths } = this;
    gpu.use(gpu.solid, { ground: gpu.map(ground), wall: gpu.map(WALL) }, { size: [width, height], depths, shift });
    gpu.draw(batch);
  }

  clears(batch, textures, isStill) {
    const { gpu, gpu: { gl }, width, height, depths } = this;
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ZERO, gl.ONE);
    gpu.use(gpu.clear, textures, { size: [width, height], depths, isStill });
    gpu.draw(batch);
    gl.disable(gl.BLEND);
  }

  // Copies the picture into a canvas of any size, by way of the card's canvas, which is large enough.
  show(context, { frame }) {
    const { gl } = this.gpu, { canvas } = gl, { width, height } = this;
    if (canvas.width < width || canvas.height < height) {
      [canvas.width, canvas.height] = [Math.max(canvas.width, width), Math.max(canvas.height, height)];
    }
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, frame);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
    gl.blitFramebuffer(0, 0, width, height, 0, height, width, 0, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.drawImage(canvas, 0, canvas.height - height, width, height, 0, 0, context.canvas.width, context.canvas.height);
  }
}

const nothing = (into, at) => into.fill(0, at, at + 4);

const seeThrough = (colour, share) => ((colour & 0xffffff) | (Math.round(share * 255) << 24)) >>> 0;
