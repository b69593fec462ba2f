// WebGL 2: meshes with decals, in one forward pass for each mesh.

const WIDTH = 4096; // texels in a row of a data texture
const CAMERA = 0; // binding of the camera's uniform block

// Textures by their names: what they hold, and how their texels lie in memory.
const DATA = {
  decal_records: { array: (decals) => decals.records, row: 4, format: "RGBA32F" },
  decal_limits: { array: (decals) => decals.limits, row: 4, format: "RGBA32F" },
  decal_index_levels: { array: (decals) => decals.index.levels, row: 4, format: "RGBA32F" },
  decal_index_table: { array: (decals) => decals.index.table, row: 4, format: "RGBA32I" },
  decal_index_ids: { array: (decals) => decals.index.ids, row: 1, format: "R32I" },
};
const FORMATS = {
  RGBA32F: ["RGBA", "FLOAT"],
  RGBA32I: ["RGBA_INTEGER", "INT"],
  R32I: ["RED_INTEGER", "INT"],
};
const IMAGE_FORMATS = {
  "srgb8-alpha8": ["SRGB8_ALPHA8", "UNSIGNED_BYTE"],
  rgba16f: ["RGBA16F", "HALF_FLOAT"],
};
const IMAGE_UNIT = 6; // of the first array of images, behind the data textures
const ATTRIBUTES = ["vertex_position", "vertex_normal", "vertex_light"];
const INDEX_TEXTURES = { levels: "decal_index_levels", table: "decal_index_table", ids: "decal_index_ids" };

export class Painter {
  constructor(canvas, header, arrays) {
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    Object.assign(this, { gl, canvas, header, programs: new Map(), textures: new Map() });
    this.camera = gl.createBuffer();
    this.pixel = this.pixelTarget();
    this.images = this.imagesOf(header.images, arrays);
    this.meshes = header.meshes.map((mesh, i) => this.meshOf(mesh, i, arrays));
  }

  program(vertex, fragment) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, text] of Object.entries({ VERTEX_SHADER: vertex, FRAGMENT_SHADER: fragment })) {
      const shader = gl.createShader(gl[kind]);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    ATTRIBUTES.forEach((name, place) => gl.bindAttribLocation(program, place, name));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      const logs = gl.getAttachedShaders(program).map((shader) => gl.getShaderInfoLog(shader));
      throw new Error(`a shader was refused: ${[gl.getProgramInfoLog(program), ...logs].join(" ")}`);
    }
    const block = gl.getUniformBlockIndex(program, "CameraBlock");
    if (block !== gl.INVALID_INDEX) gl.uniformBlockBinding(program, block, CAMERA);
    const places = new Map();
    return {
      program,
      place(name) {
        if (!places.has(name)) places.set(name, gl.getUniformLocation(program, name));
        return places.get(name);
      },
    };
  }

  // A target of one pixel, without antialiasing.
  pixelTarget() {
    const { gl } = this;
    const target = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    for (const [place, format] of [
      [gl.COLOR_ATTACHMENT0, gl.RGBA8],
      [gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT16],
    ]) {
      const buffer = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, 1, 1);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, buffer);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return target;
  }

  // The program that draws, or picks, in a contact mode: compiled when it is first used.
  programOf(mode, kind, full) {
    const form = full ? "full" : "plain";
    const key = `${mode} ${kind} ${form}`;
    if (!this.programs.has(key)) {
      const { vertex, modes, ends } = this.header.shaders;
      this.programs.set(key, this.program(vertex, `${modes[mode][form]}${ends[kind]}`));
    }
    return this.programs.get(key);
  }

  meshOf({ mask, color }, i, arrays) {
    const { gl } = this;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const colors = arrays[`color ${i}`];
    const layout = [
      [0, arrays[`vertices ${i}`], 3, gl.FLOAT, false],
      [1, arrays[`normals ${i}`], 3, gl.SHORT, true],
      [2, colors, 3, gl.FLOAT, false],
    ];
    for (const [place, data, size, kind, normalized] of layout) {
      if (!data) continue; // one colour for all vertices
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, kind, normalized, 0, 0);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, arrays[`faces ${i}`], gl.STATIC_DRAW);
    return { array, count: arrays[`faces ${i}`].length, mask, color: colors ? null : color };
  }

  // Make the texture arrays of decal images and their maps; return their units by name.
  imagesOf({ textures, anisotropy, isotropic }, arrays) {
    const { gl } = this;
    const renderer = gl.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER;
    const name = gl.getParameter(renderer);
    const wrong = isotropic.some((part) => name.includes(part)); // see `_anisotropy` of decals/rendering/context.py
    const anisotropic = wrong ? null : gl.getExtension("EXT_texture_filter_anisotropic");
    return Object.entries(textures).map(([name, { size, format, levels }], i) => {
      const unit = IMAGE_UNIT + i;
      const [inner, kind] = IMAGE_FORMATS[format].map((word) => gl[word]);
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D_ARRAY, gl.createTexture());
      for (let level = 0; level < levels; level++) {
        const [width, height] = size.map((side) => Math.max(1, side >> level));
        const texels = arrays[`${name} ${level}`];
        gl.texImage3D(gl.TEXTURE_2D_ARRAY, level, inner, width, height, size[2], 0, gl.RGBA, kind, texels);
      }
      const options = {
        MIN_FILTER: "LINEAR_MIPMAP_LINEAR",
        WRAP_S: "CLAMP_TO_EDGE",
        WRAP_T: "CLAMP_TO_EDGE",
      };
      for (const [option, value] of Object.entries(options)) {
        gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl[`TEXTURE_${option}`], gl[value]);
      }
      if (anisotropic) {
        const most = gl.getParameter(anisotropic.MAX_TEXTURE_MAX_ANISOTROPY_EXT);
        const option = anisotropic.TEXTURE_MAX_ANISOTROPY_EXT;
        gl.texParameterf(gl.TEXTURE_2D_ARRAY, option, Math.min(anisotropy, most));
      }
      return [name, unit];
    });
  }

  // Bring decals and index to the graphics card: what changed, or all of it.
  upload(decals) {
    const rows = decals.takeChanges();
    const lists = decals.index.takeChanges();
    const ranges = new Map(Object.keys(DATA).map((name) => [name, []]));
    for (const number of rows ?? []) {
      ranges.get("decal_records").push([4 * number, 4]);
      ranges.get("decal_limits").push([number, 1]);
    }
    for (const [name, first, count] of lists ?? []) ranges.get(INDEX_TEXTURES[name]).push([first, count]);
    for (const [name, { array, row, format }] of Object.entries(DATA)) {
      const data = array(decals);
      const whole = name.startsWith("decal_index") ? lists === null : rows === null;
      if (whole || !this.textures.has(name)) this.store(name, data, row, format);
      else for (const [first, count] of ranges.get(name)) this.write(name, data, row, format, first, count);
    }
  }

  // Make a data texture anew.
  store(name, data, row, format) {
    const { gl } = this;
    const rows = Math.max(1, Math.ceil(data.length / (row * WIDTH)));
    if (rows > gl.getParameter(gl.MAX_TEXTURE_SIZE))
      throw new Error("there are too many decals for this device");
    const padded = new data.constructor(rows * WIDTH * row);
    padded.set(data);
    if (this.textures.has(name)) gl.deleteTexture(this.textures.get(name));
    const texture = gl.createTexture();
    this.textures.set(name, texture);
    this.bind(name);
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
      gl.texParameteri(gl.TEXTURE_2D, side, gl.NEAREST);
    }
    const [texels, kind] = FORMATS[format].map((word) => gl[word]);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl[format], WIDTH, rows, 0, texels, kind, padded);
  }

  // Overwrite some rows of a data texture.
  write(name, data, row, format, first, count) {
    const { gl } = this;
    this.bind(name);
    const [texels, kind] = FORMATS[format].map((word) => gl[word]);
    for (let done = 0; done < count;) {
      const [x, y] = [(first + done) % WIDTH, Math.floor((first + done) / WIDTH)];
      const width = Math.min(WIDTH - x, count - done);
      const part = data.subarray(row * (first + done), row * (first + done + width));
      gl.texSubImage2D(gl.TEXTURE_2D, 0, x, y, width, 1, texels, kind, part);
      done += width;
    }
  }

  // Bind a data texture to its unit, and return the unit.
  bind(name) {
    const unit = Object.keys(DATA).indexOf(name);
    this.gl.activeTexture(this.gl.TEXTURE0 + unit);
    this.gl.bindTexture(this.gl.TEXTURE_2D, this.textures.get(name));
    return unit;
  }

  // Draw the picture; the page's background shows around it.
  draw(state) {
    this.gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    this.drawMeshes("color", state);
  }

  // Wait until the picture is drawn: in browsers only a read does so.
  finish() {
    this.gl.readPixels(0, 0, 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, new Uint8Array(4));
  }

  // The number of the decal at a pixel, counted from the lower left; −1 for none.
  owner(state, x, y) {
    const { gl, canvas } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.pixel);
    gl.viewport(-x, -y, canvas.width, canvas.height);
    this.drawMeshes("pick", state);
    const bytes = new Uint8Array(4);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return bytes[0] + 256 * bytes[1] + 65536 * bytes[2] - 1;
  }

  useCamera(camera) {
    const { gl } = this;
    const { width, height } = this.canvas;
    const block = new Float32Array(32);
    block.set(camera.matrix(width / height));
    camera.rays(width, height).forEach((vector, i) => block.set(vector, 16 + 4 * i));
    block[19] = 1; // in perspective
    gl.bindBufferBase(gl.UNIFORM_BUFFER, CAMERA, this.camera);
    gl.bufferData(gl.UNIFORM_BUFFER, block, gl.DYNAMIC_DRAW);
  }

  drawMeshes(kind, { camera, decals, mode, stiffness, lit }) {
    const { gl } = this;
    const program = this.programOf(mode, kind, decals.full);
    gl.enable(gl.DEPTH_TEST);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.upload(decals);
    this.useCamera(camera);
    gl.useProgram(program.program);
    const numbers = {
      decal_index_level_count: decals.index.levelCount,
      decal_index_mask: decals.index.mask,
      decal_mapping: this.header.mapping,
      lit: lit ? 1 : 0,
    };
    for (const name of Object.keys(DATA)) numbers[name] = this.bind(name);
    for (const [name, unit] of this.images) numbers[name] = unit;
    for (const [name, value] of Object.entries(numbers)) gl.uniform1i(program.place(name), value);
    gl.uniform1f(program.place("decal_stiffness"), stiffness);
    for (const mesh of this.meshes) {
      gl.uniform1i(program.place("decal_surface_receivers"), mesh.mask);
      gl.bindVertexArray(mesh.array);
      if (mesh.color) gl.vertexAttrib3f(2, ...mesh.color);
      gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
    }
  }
}
