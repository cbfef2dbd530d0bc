// A graphics card, through WebGL2, for all pictures of a page: programs, batches of polygons, and
// textures to draw into.
//
// Polygons have the raster's form: x, y in samples, y downwards, and w, which is linear on the
// picture. So a linear map turns w into a depth, and no division by a distance is necessary.

const WORDS = 9; // numbers of a corner: x, y, w, a colour, four numbers and a kind
const FEW = 1024; // number of corners for which a batch has room at first
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i; // names of renderers in software

const CORNERS = `#version 300 es
precision highp float;
in vec3 place;
in vec4 colour, more;
in float kind;
uniform vec2 size, depths; // samples of the picture; w of what is farthest, and from there to what is nearest
out float w, what;
out vec4 paint, data;
void main() {
  w = place.z;
  what = kind;
  paint = colour;
  data = more;
  gl_Position = vec4(2.0 * place.xy / size - 1.0, 1.0 - 2.0 * (w - depths.x) / depths.y, 1.0);
}`;

const HEAD = `#version 300 es
precision highp float;
precision highp sampler2D;
in float w, what;
in vec4 paint, data;
out vec4 shown;
`;

// In the light of a map; \`data\` contains the place in the map: (x, y) / (w + shift) + (z, w).
const SOLID = `${HEAD}
uniform sampler2D ground, wall;
uniform float shift;
float light(sampler2D map) {
  ivec2 at = ivec2(data.xy / (w + shift) + data.zw);
  return texelFetch(map, clamp(at, ivec2(0), textureSize(map, 0) - 1), 0).r * 255.0;
}
void main() {
  float k = what < 0.5 ? 256.0 : what < 1.5 ? light(ground) : light(wall);
  shown = vec4(floor(paint.rgb * 255.0 * round(k) / 256.0) / 255.0, 1.0);
}`;

// Translucent, in front of static and moving things. \`data\`: 1 to leave out moving things; for
// hatching, the samples from line to line, and of a line.
const CLEAR = `${HEAD}
uniform sampler2D stillDepth, movingDepth;
uniform float isStill;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  float moving = isStill > 0.5 ? 1.0 : texelFetch(movingDepth, at, 0).r;
  if (gl_FragCoord.z >= texelFetch(stillDepth, at, 0).r || gl_FragCoord.z >= moving) discard;
  if (data.x > 0.5 && moving < 1.0) discard;
  float line = data.y > 0.5 && mod(float(at.x + at.y), data.y) >= data.z ? 0.25 : 1.0;
  shown = vec4(paint.rgb, paint.a * line);
}`;

const ALL = `#version 300 es
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1, 0, 1);
}`;

// Moving things in front of static ones; behind these, they shine through.
const MERGED = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D stillColour, movingColour, stillDepth, movingDepth;
uniform float through;
out vec4 shown;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 still = texelFetch(stillColour, at, 0), moving = texelFetch(movingColour, at, 0);
  float far = texelFetch(movingDepth, at, 0).r, hidden = far > texelFetch(stillDepth, at, 0).r ? through : 1.0;
  shown = far == 1.0 ? still : mix(still, moving, hidden);
}`;

// Polygons that are drawn together as triangles.
export class Batch {
  constructor() {
    this.room(FEW);
    this.clear();
  }

  clear() {
    this.corners = this.indices = 0;
  }

  // Makes room for so many corners; polygons have fewer triangles than corners.
  room(corners) {
    const { words, index } = this;
    this.words = new Float32Array(WORDS * corners);
    this.colours = new Uint32Array(this.words.buffer);
    this.index = new Uint32Array(3 * corners);
    if (words) this.words.set(words);
    if (index) this.index.set(index);
  }

  // Adds a convex polygon of n corners. `more` writes four numbers for the corner at x, y to an array.
  add(p, n, colour, kind, more) {
    if (WORDS * (this.corners + n) > this.words.length) this.room(2 * (this.corners + n));
    const { words, colours, index } = this, first = this.corners;
    for (let i = 0, at = WORDS * first; i < 3 * n; i += 3, at += WORDS) {
      words[at] = p[i];
      words[at + 1] = p[i + 1];
      words[at + 2] = p[i + 2];
      colours[at + 3] = colour;
      more(words, at + 4, p[i], p[i + 1]);
      words[at + 8] = kind;
    }
    for (let k = 2; k < n; k++) {
      index[this.indices++] = first;
      index[this.indices++] = first + k - 1;
      index[this.indices++] = first + k;
    }
    this.corners += n;
  }
}

class Gpu {
  constructor(gl) {
    this.gl = gl;
    this.isLost = false;
    gl.canvas.addEventListener("webglcontextlost", () => (this.isLost = true));
    this.solid = this.program(CORNERS, SOLID);
    this.clear = this.program(CORNERS, CLEAR);
    this.merged = this.program(ALL, MERGED);
    this.maps = new WeakMap(); // textures, by array
    this.layout();
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  }

  // A program, with the locations of its uniforms by name.
  program(corners, samples) {
    const { gl } = this, program = gl.createProgram();
    [[gl.VERTEX_SHADER, corners], [gl.FRAGMENT_SHADER, samples]].forEach(([kind, text]) => {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    });
    ["place", "colour", "more", "kind"].forEach((name, k) => gl.bindAttribLocation(program, k, name));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(program));
    const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) ?? 0, uniforms = {};
    for (let k = 0; k < count; k++) {
      const { name } = gl.getActiveUniform(program, k);
      uniforms[name] = gl.getUniformLocation(program, name);
    }
    return { program, uniforms };
  }

  // The layout of a corner's numbers.
  layout() {
    const { gl } = this, bytes = 4 * WORDS;
    gl.bindVertexArray(gl.createVertexArray());
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    [[3, gl.FLOAT, false, 0], [4, gl.UNSIGNED_BYTE, true, 12], [4, gl.FLOAT, false, 16], [1, gl.FLOAT, false, 32]]
      .forEach(([count, type, isShare, at], k) => {
        gl.enableVertexAttribArray(k);
        gl.vertexAttribPointer(k, count, type, isShare, bytes, at);
      });
  }

  // Uses a program, with textures and numbers by the names of its uniforms.
  use({ program, uniforms }, textures, numbers) {
    const { gl } = this;
    gl.useProgram(program);
    Object.entries(textures).forEach(([name, texture], k) => {
      gl.activeTexture(gl.TEXTURE0 + k);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(uniforms[name], k);
    });
    for (const [name, value] of Object.entries(numbers)) {
      if (Array.isArray(value)) gl.uniform2f(uniforms[name], ...value);
      else gl.uniform1f(uniforms[name], value);
    }
  }

  draw(batch) {
    const { gl } = this;
    if (!batch.indices) return;
    gl.bufferData(gl.ARRAY_BUFFER, batch.words.subarray(0, WORDS * batch.corners), gl.STREAM_DRAW);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, batch.index.subarray(0, batch.indices), gl.STREAM_DRAW);
    gl.drawElements(gl.TRIANGLES, batch.indices, gl.UNSIGNED_INT, 0);
  }

  texture(format, width, height) {
    const { gl } = this, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
    for (const name of ["TEXTURE_MIN_FILTER", "TEXTURE_MAG_FILTER"]) gl.texParameteri(gl.TEXTURE_2D, gl[name], gl.NEAREST);
    return texture;
  }

  // A map of light as a texture.
  map({ map, columns, rows }) {
    const { gl } = this;
    if (!this.maps.has(map)) {
      const texture = this.texture(gl.R8, columns, rows);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, columns, rows, gl.RED, gl.UNSIGNED_BYTE, map);
      this.maps.set(map, texture);
    }
    return this.maps.get(map);
  }

  // A texture to draw into, optionally with depths.
  target(width, height, hasDepth) {
    const { gl } = this, frame = gl.createFramebuffer(), colour = this.texture(gl.RGBA8, width, height);
    const depth = hasDepth ? this.texture(gl.DEPTH_COMPONENT24, width, height) : null;
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, colour, 0);
    if (depth) gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, depth, 0);
    return { frame, colour, depth };
  }

  release({ frame, colour, depth }) {
    const { gl } = this;
    gl.deleteFramebuffer(frame);
    gl.deleteTexture(colour);
    if (depth) gl.deleteTexture(depth);
  }
}

// The graphics card of this page, if there is one; a renderer in software counts only on request.
export function openGpu(isAnyWelcome) {
  const how = { alpha: false, antialias: false, depth: false, failIfMajorPerformanceCaveat: !isAnyWelcome };
  const gl = document.createElement("canvas").getContext("webgl2", how);
  if (!gl) return undefined;
  const known = gl.getExtension("WEBGL_debug_renderer_info");
  const name = String(gl.getParameter(known ? known.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  if (isAnyWelcome || !SOFTWARE.test(name)) {
    try {
      return new Gpu(gl);
    } catch (error) {
      console.warn(`Drawn without the graphics card: ${error.message}`); // e.g. a shader that the driver rejects
    }
  }
  gl.getExtension("WEBGL_lose_context")?.loseContext(); // frees its memory
  return undefined;
}
