// The picture, as decals/rendering draws it: surfaces into textures, then decals and light over the whole picture.
import { Program, makeTarget, makeTexture, uploaded } from "./graphics.mjs";
import { ROW } from "./texels.mjs";

const SEEN = ["g_position", "g_normal", "g_color"]; // textures of what a camera sees

export class Painter {
  constructor(canvas, header, arrays) {
    const gl = canvas.getContext("webgl2", { antialias: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    if (!gl.getExtension("EXT_color_buffer_float")) throw new Error("this device cannot draw float textures");
    const side = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    if (side < ROW) throw new Error(`textures have ${side} texels here, and ${ROW} are needed`);
    Object.assign(this, { gl, canvas, header, programs: {}, textures: {}, screen: gl.createVertexArray() });
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.cullFace(gl.FRONT);
    gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, gl.createBuffer()); // of the camera
    this.picked = makeTarget(gl, [2, 1], [header.targets.picked]);
    const renderer = gl.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER;
    const device = gl.getParameter(renderer);
    const own = header.isotropic.some((part) => device.includes(part)) ? { anisotropy: 0 } : {};
    for (const [name, { levels, ...description }] of Object.entries(header.textures)) {
      const texels = levels.map((level) => arrays[level]);
      this.textures[name] = makeTexture(gl, { ...description, ...own }, texels);
    }
    this.surfaces = header.surfaces.map((surface) => this.surfaceOf(surface, arrays));
  }

  // A surface with a vertex array of its attributes.
  surfaceOf({ program, attributes, faces, parts, box }, arrays) {
    const { gl } = this;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const store = (target, data) => {
      gl.bindBuffer(target, gl.createBuffer());
      gl.bufferData(target, arrays[data], gl.STATIC_DRAW);
    };
    for (const [attribute, [data, size, kind]] of Object.entries(attributes)) {
      const place = gl.getAttribLocation(this.surfaceProgram(program).program, attribute);
      store(gl.ARRAY_BUFFER, data);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, gl[kind], true, 0, 0);
    }
    store(gl.ELEMENT_ARRAY_BUFFER, faces);
    return { program, array, parts, box };
  }

  // The program of surfaces of a kind, compiled when it is first used.
  surfaceProgram = (name) => (this.programs[name] ??= new Program(this.gl, this.header.programs[name]));

  // The program that draws, or picks, in a contact mode, compiled when it is first used.
  decalProgram(kind, { mode, decals }) {
    const { screen, modes, ends } = this.header.shaders;
    const form = decals.full ? "full" : "plain";
    const texts = [screen, `${modes[mode][form]}${ends[kind]}`];
    return (this.programs[`${kind} ${mode} ${form}`] ??= new Program(this.gl, texts));
  }

  // Draw all surfaces as a camera sees them, with a shift of the picture in pixels: what decals and light read.
  look(camera, shift) {
    const { gl, canvas } = this;
    const size = [canvas.width, canvas.height];
    const block = camera.block(...size, shift);
    const view = `${size} ${block}`;
    if (view === this.view) return;
    if (`${size}` !== `${this.seen?.size}`) {
      const descriptions = SEEN.map((name) => this.header.targets[name]);
      this.seen = makeTarget(gl, size, descriptions, this.seen);
      SEEN.forEach((name, i) => (this.textures[name] = this.seen.textures[i]));
    }
    this.view = view;
    gl.bufferData(gl.UNIFORM_BUFFER, block, gl.DYNAMIC_DRAW);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.seen.framebuffer);
    gl.viewport(0, 0, ...size);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    for (const { program, array, parts, box } of this.surfaces) {
      gl.bindVertexArray(array);
      if (box) gl.enable(gl.CULL_FACE); // its back has one fragment for each ray
      for (const { values, first, count } of parts) {
        this.surfaceProgram(program).use(values, this.textures);
        gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 4 * first);
      }
      gl.disable(gl.CULL_FACE);
    }
    gl.disable(gl.DEPTH_TEST);
  }

  // Draw over a whole target what decals and light make of the surfaces, or what lies at a place, from −1 to 1.
  paint(kind, { framebuffer, size }, { mode, decals, stiffness, selected }, place = [0, 0]) {
    const { gl, header, textures } = this;
    for (const [ending, texels] of Object.entries(decals.texels)) {
      const name = `decal_${ending}`;
      textures[name] = uploaded(gl, texels, header.targets[name], textures[name]);
    }
    const { position = [0, 0, 0], radius = 0 } = decals.rows[selected] ?? {};
    const values = {
      ...header.uniforms,
      place: ["2f", ...place],
      tile_size: ["2i", ...this.seen.size],
      decal_index_level_count: ["1i", decals.index.levelOf.size],
      decal_index_mask: ["1i", decals.index.mask],
      decal_stiffness: ["1f", stiffness],
      rim: ["4f", ...position, radius],
    };
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.viewport(0, 0, ...size);
    this.decalProgram(kind, { mode, decals }).use(values, textures);
    gl.bindVertexArray(this.screen);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  // Draw one sample of the picture over the mean of those before it; the page's background shows around it.
  draw(state, sample = 0) {
    const { gl } = this;
    this.decalProgram("color", state); // compiled beside those of surfaces
    this.look(state.camera, this.header.samples[sample]);
    gl.enable(gl.BLEND);
    gl.blendColor(0, 0, 0, 1 / (sample + 1));
    gl.blendFunc(gl.CONSTANT_ALPHA, gl.ONE_MINUS_CONSTANT_ALPHA);
    this.paint("color", { framebuffer: null, size: this.seen.size }, state);
    gl.disable(gl.BLEND);
    this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }

  isBusy = () => this.gl.clientWaitSync(this.fence, 0, 0) === this.gl.TIMEOUT_EXPIRED;

  // What a camera sees at a place of the picture, from −1 to 1 to the right and upward: the number of the decal, −1 for
  // none, and the surface as a point and the normal on the outside, null for none.
  pick(state, place) {
    const { gl } = this;
    this.look(state.camera);
    this.paint("pick", this.picked, state, place);
    const numbers = new Float32Array(8);
    gl.readPixels(0, 0, 2, 1, gl.RGBA, gl.FLOAT, numbers);
    const [x, y, z, number, ...normal] = numbers;
    const surface = normal.pop() > 0 ? { position: [x, y, z], normal } : null;
    return { number: surface ? number : -1, surface };
  }
}
