// The picture, as decals/rendering draws it: surfaces into textures, then decals and light over the whole picture.
import { Program, makeTarget, makeTexture, uploaded } from "./graphics.mjs";
import { ROW } from "./texels.mjs";

const BOX = 36; // vertices of a box, in which a tree is traced

// Places in a pixel at which it is drawn, one after the other: the picture is the mean of all.
export const SAMPLES = [
  [0, 0],
  [0.125, 0.375],
  [0.375, -0.125],
  [-0.125, -0.375],
  [-0.375, 0.125],
];

export class Painter {
  constructor(canvas, header, arrays) {
    const gl = canvas.getContext("webgl2", { antialias: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    if (!gl.getExtension("EXT_color_buffer_float"))
      throw new Error("this device cannot draw into textures of float numbers");
    if (gl.getParameter(gl.MAX_TEXTURE_SIZE) < ROW)
      throw new Error(`this device has no textures of ${ROW} texels`);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    Object.assign(this, { gl, canvas, header, programs: new Map(), camera: gl.createBuffer() });
    gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, this.camera);
    this.screen = gl.createVertexArray();
    this.pixel = makeTarget(gl, [1, 1], ["R32I"]);
    this.textures = this.texturesOf(header, arrays);
    this.surfaces = header.surfaces.map((surface) => this.surfaceOf(surface, arrays));
  }

  texturesOf({ textures, isotropic }, arrays) {
    const { gl } = this;
    const renderer = gl.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER;
    const name = gl.getParameter(renderer);
    const isWrong = isotropic.some((part) => name.includes(part)); // see `_anisotropy` of decals/rendering/context.py
    const made = Object.entries(textures).map(([name, { levels, anisotropy, ...description }]) => {
      const texels = Array.from({ length: levels }, (_, level) => arrays[`${name} ${level}`]);
      return [name, makeTexture(gl, { ...description, anisotropy: isWrong ? 0 : anisotropy }, texels)];
    });
    return Object.fromEntries(made);
  }

  // A surface with its program, and with a vertex array of its attributes.
  surfaceOf({ program: name, attributes, faces, parts }, arrays) {
    const { gl } = this;
    const program = this.programOf(name, ...this.header.shaders.surfaces[name]);
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const store = (target, data) => {
      gl.bindBuffer(target, gl.createBuffer());
      gl.bufferData(target, data, gl.STATIC_DRAW);
    };
    for (const [attribute, [data, size]] of Object.entries(attributes)) {
      const place = gl.getAttribLocation(program.program, attribute);
      store(gl.ARRAY_BUFFER, arrays[data]);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(
        place,
        size,
        arrays[data] instanceof Int16Array ? gl.SHORT : gl.FLOAT,
        true,
        0,
        0,
      );
    }
    if (faces) store(gl.ELEMENT_ARRAY_BUFFER, arrays[faces]);
    return { program, array, parts };
  }

  // A program by its name, compiled when it is first used.
  programOf(name, vertex, fragment) {
    if (!this.programs.has(name)) this.programs.set(name, new Program(this.gl, vertex, fragment));
    return this.programs.get(name);
  }

  // The program that draws, or picks, in a contact mode.
  decalProgram(kind, { mode, decals }) {
    const { screen, modes, ends } = this.header.shaders;
    const form = decals.full ? "full" : "plain";
    return this.programOf(`${kind} ${mode} ${form}`, screen, `${modes[mode][form]}${ends[kind]}`);
  }

  // Draw all surfaces as a camera sees them, with a shift of the picture in pixels: what decals and light read.
  look(camera, shift = [0, 0]) {
    const { gl, canvas } = this;
    const size = [canvas.width, canvas.height];
    const block = camera.block(...size, shift);
    const view = `${size} ${block}`;
    if (view === this.view) return;
    if (`${size}` !== this.size) {
      this.seen?.release();
      this.seen = makeTarget(gl, size, ["RGBA32F", "RGBA32F", "RGBA16F"]);
      const [g_position, g_normal, g_color] = this.seen.textures;
      Object.assign(this.textures, { g_position, g_normal, g_color });
    }
    Object.assign(this, { view, size: `${size}` });
    gl.bufferData(gl.UNIFORM_BUFFER, block, gl.DYNAMIC_DRAW);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.seen.framebuffer);
    gl.viewport(0, 0, ...size);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.cullFace(gl.FRONT);
    for (const { program, array, parts } of this.surfaces) {
      gl.bindVertexArray(array);
      for (const { values, first, count } of parts) {
        program.use(values, this.textures);
        if (count) {
          gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 4 * first);
        } else {
          gl.enable(gl.CULL_FACE); // the back of a box has one fragment for each ray
          gl.drawArrays(gl.TRIANGLES, 0, BOX);
          gl.disable(gl.CULL_FACE);
        }
      }
    }
    gl.disable(gl.DEPTH_TEST);
  }

  // Draw over a whole target what decals and light make of the surfaces.
  paint(kind, state, corner = [0, 0]) {
    const { gl, canvas } = this;
    const { decals, stiffness } = state;
    for (const [name, texels] of Object.entries(decals.texels)) this.textures[name] = uploaded(gl, texels);
    const values = {
      ...this.header.uniforms,
      corner: ["2i", ...corner],
      tile_size: ["2i", canvas.width, canvas.height],
      decal_index_level_count: ["1i", decals.index.levelCount],
      decal_index_mask: ["1i", decals.index.mask],
      decal_stiffness: ["1f", stiffness],
    };
    this.decalProgram(kind, state).use(values, this.textures);
    gl.bindVertexArray(this.screen);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  // Draw one sample of the picture over the mean of those before it; the page's background shows around it.
  draw(state, sample = 0) {
    const { gl, canvas } = this;
    this.look(state.camera, SAMPLES[sample]);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.enable(gl.BLEND);
    gl.blendColor(0, 0, 0, 1 / (sample + 1));
    gl.blendFunc(gl.CONSTANT_ALPHA, gl.ONE_MINUS_CONSTANT_ALPHA);
    this.paint("color", state);
    gl.disable(gl.BLEND);
  }

  // Wait until the picture is drawn: in browsers only a read does so.
  finish() {
    this.gl.readPixels(0, 0, 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, new Uint8Array(4));
  }

  // The number of the decal at a pixel, counted from the lower left; −1 for none.
  owner(state, x, y) {
    const { gl } = this;
    const number = new Int32Array(4);
    this.look(state.camera);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.pixel.framebuffer);
    gl.viewport(0, 0, 1, 1);
    this.paint("pick", state, [x, y]);
    gl.readPixels(0, 0, 1, 1, gl.RGBA_INTEGER, gl.INT, number);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return number[0];
  }

  // The surface that a camera sees at a pixel: a point, and the normal on the outside; null if there is none.
  surface(camera, x, y) {
    const { gl } = this;
    this.look(camera);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.seen.framebuffer);
    const [point, normal] = [gl.COLOR_ATTACHMENT0, gl.COLOR_ATTACHMENT1].map((attachment) => {
      const numbers = new Float32Array(4);
      gl.readBuffer(attachment);
      gl.readPixels(x, y, 1, 1, gl.RGBA, gl.FLOAT, numbers);
      return Array.from(numbers);
    });
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return point[3] > 0 ? { position: point.slice(0, 3), normal: normal.slice(0, 3) } : null;
  }
}
