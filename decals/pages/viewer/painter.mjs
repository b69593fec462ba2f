// The picture, as decals/rendering draws it: surfaces into textures, then decals and light over the whole picture.
import { Program, makeTarget, makeTexture, uploaded } from "./graphics.mjs";
import { ROW } from "./texels.mjs";

export class Painter {
  constructor(canvas, header, arrays) {
    const gl = canvas.getContext("webgl2", { antialias: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    if (!gl.getExtension("EXT_color_buffer_float")) throw new Error("this device cannot draw float textures");
    const side = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    if (side < ROW) throw new Error(`textures have ${side} texels here, and ${ROW} are needed`);
    Object.assign(this, { gl, canvas, header, programs: new Map() });
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.cullFace(gl.FRONT);
    gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, gl.createBuffer()); // of the camera
    this.screen = gl.createVertexArray();
    this.pixel = makeTarget(gl, [1, 1], [header.targets.number]);
    this.textures = this.texturesOf(header, arrays);
    this.surfaces = header.surfaces.map((surface) => this.surfaceOf(surface, arrays));
  }

  texturesOf({ textures, isotropic }, arrays) {
    const { gl } = this;
    const renderer = gl.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER;
    const device = gl.getParameter(renderer);
    const own = isotropic.some((part) => device.includes(part)) ? { anisotropy: 0 } : {};
    const made = Object.entries(textures).map(([name, { levels, ...description }]) => {
      const texels = Array.from({ length: levels }, (_, level) => arrays[`${name} ${level}`]);
      return [name, makeTexture(gl, { ...description, ...own }, texels)];
    });
    return Object.fromEntries(made);
  }

  // A surface with its program, and with a vertex array of its attributes.
  surfaceOf({ program: name, attributes, faces, parts }, arrays) {
    const { gl } = this;
    const [array, program] = [gl.createVertexArray(), this.programOf(name, () => this.header.programs[name])];
    gl.bindVertexArray(array);
    const store = (target, data) => {
      gl.bindBuffer(target, gl.createBuffer());
      gl.bufferData(target, arrays[data], gl.STATIC_DRAW);
    };
    for (const [attribute, [data, size, kind]] of Object.entries(attributes)) {
      const place = gl.getAttribLocation(program.program, attribute);
      store(gl.ARRAY_BUFFER, data);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, gl[kind], true, 0, 0);
    }
    if (faces) store(gl.ELEMENT_ARRAY_BUFFER, faces);
    return { program, array, parts };
  }

  // A program by its name, compiled from its two shaders when it is first used.
  programOf(name, shaders) {
    if (!this.programs.has(name)) this.programs.set(name, new Program(this.gl, ...shaders()));
    return this.programs.get(name);
  }

  // The program that draws, or picks, in a contact mode.
  decalProgram(kind, { mode, decals }) {
    const { screen, modes, ends } = this.header.shaders;
    const form = decals.full ? "full" : "plain";
    return this.programOf(`${kind} ${mode} ${form}`, () => [screen, `${modes[mode][form]}${ends[kind]}`]);
  }

  // Draw all surfaces as a camera sees them, with a shift of the picture in pixels: what decals and light read.
  look(camera, shift) {
    const { gl, canvas } = this;
    const size = [canvas.width, canvas.height];
    const block = camera.block(...size, shift);
    const view = `${size} ${block}`;
    if (view === this.view) return;
    if (`${size}` !== this.size) {
      this.seen?.release();
      const names = ["g_position", "g_normal", "g_color"];
      this.seen = makeTarget(
        gl,
        size,
        names.map((name) => this.header.targets[name]),
      );
      names.forEach((name, i) => (this.textures[name] = this.seen.textures[i]));
    }
    Object.assign(this, { view, size: `${size}` });
    gl.bufferData(gl.UNIFORM_BUFFER, block, gl.DYNAMIC_DRAW);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.seen.framebuffer);
    gl.viewport(0, 0, ...size);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    for (const { program, array, parts } of this.surfaces) {
      gl.bindVertexArray(array);
      for (const { values, first, count, box } of parts) {
        program.use(values, this.textures);
        if (box) gl.enable(gl.CULL_FACE); // its back has one fragment for each ray
        if (box) gl.drawArrays(gl.TRIANGLES, 0, count);
        else gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 4 * first);
        gl.disable(gl.CULL_FACE);
      }
    }
    gl.disable(gl.DEPTH_TEST);
  }

  // Draw over a whole target what decals and light make of the surfaces.
  paint(kind, { mode, decals, stiffness, selected }, corner = [0, 0]) {
    const { gl, canvas, header, textures } = this;
    for (const [name, texels] of Object.entries(decals.texels))
      textures[name] = uploaded(gl, texels, header.targets[name]);
    const values = {
      ...header.uniforms,
      corner: ["2i", ...corner],
      tile_size: ["2i", canvas.width, canvas.height],
      decal_index_level_count: ["1i", decals.index.levelOf.size],
      decal_index_mask: ["1i", decals.index.mask],
      decal_stiffness: ["1f", stiffness],
      rim: ["4f", ...(decals.rows[selected]?.position ?? [0, 0, 0]), decals.rows[selected]?.radius ?? 0],
    };
    this.decalProgram(kind, { mode, decals }).use(values, textures);
    gl.bindVertexArray(this.screen);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  // Draw one sample of the picture over the mean of those before it; the page's background shows around it.
  draw(state, sample = 0) {
    const { gl, canvas } = this;
    this.look(state.camera, this.header.samples[sample]);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.enable(gl.BLEND);
    gl.blendColor(0, 0, 0, 1 / (sample + 1));
    gl.blendFunc(gl.CONSTANT_ALPHA, gl.ONE_MINUS_CONSTANT_ALPHA);
    this.paint("color", state);
    gl.disable(gl.BLEND);
    this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }

  get isBusy() {
    return this.gl.clientWaitSync(this.fence, 0, 0) === this.gl.TIMEOUT_EXPIRED;
  }

  // Numbers of a pixel of a target, counted from the lower left; a read ends when all drawing has ended.
  read(target, place, [x, y], kind = "FLOAT", numbers = new Float32Array(4)) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    gl.readBuffer(target ? gl.COLOR_ATTACHMENT0 + place : gl.BACK);
    gl.readPixels(x, y, 1, 1, kind === "INT" ? gl.RGBA_INTEGER : gl.RGBA, gl[kind], numbers);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return Array.from(numbers);
  }

  // Wait until the picture is drawn.
  finish() {
    this.read(null, 0, [0, 0], "UNSIGNED_BYTE", new Uint8Array(4));
  }

  // The number of the decal at a pixel; −1 for none.
  owner(state, pixel) {
    const { gl } = this;
    this.look(state.camera);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.pixel.framebuffer);
    gl.viewport(0, 0, 1, 1);
    this.paint("pick", state, pixel);
    return this.read(this.pixel.framebuffer, 0, [0, 0], "INT", new Int32Array(4))[0];
  }

  // The surface that a camera sees at a pixel: a point, and the normal on the outside; null if there is none.
  surface(camera, pixel) {
    this.look(camera);
    const [point, normal] = [0, 1].map((place) => this.read(this.seen.framebuffer, place, pixel));
    return point[3] > 0 ? { position: point.slice(0, 3), normal: normal.slice(0, 3) } : null;
  }
}
