// WebGL 2: programs that take their uniforms by name, textures, and targets of drawing.
import { ROW } from "./texels.mjs";

export class Program {
  // `texts` are those of the vertex and the fragment shader.
  constructor(gl, texts) {
    const program = gl.createProgram();
    const shaders = texts.map((text, i) => {
      const shader = gl.createShader([gl.VERTEX_SHADER, gl.FRAGMENT_SHADER][i]);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      return shader;
    });
    gl.linkProgram(program); // beside other programs, until one of them is used
    Object.assign(this, { gl, program, shaders });
  }

  // Use the program with the values of its uniforms: a texture's name, or the ending and the arguments of `uniform…`.
  use(values, textures) {
    const { gl, program, shaders } = this;
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      const logs = [gl.getProgramInfoLog(program), ...shaders.map((shader) => gl.getShaderInfoLog(shader))];
      throw new Error(`this device refuses a shader: ${logs.join(" ")}`);
    }
    gl.useProgram(program);
    let unit = 0;
    for (const [name, value] of Object.entries(values)) {
      const place = gl.getUniformLocation(program, name);
      if (Array.isArray(value)) gl[`uniform${value[0]}`](place, ...value.slice(1));
      else if (place) {
        gl.activeTexture(gl.TEXTURE0 + unit);
        gl.bindTexture(textures[value].target, textures[value].texture);
        gl.uniform1i(place, unit++);
      }
    }
  }
}

// Make a texture as decals/pages/textures.py describes it, of levels of texels, null for one without contents; or make
// one anew.
export function makeTexture(gl, description, levels = [null], texture = gl.createTexture()) {
  const { target: kind, format, size, options, mips, anisotropy } = description;
  const target = gl[kind];
  const [internal, ...inMemory] = format.map((word) => gl[word]);
  gl.bindTexture(target, texture);
  levels.forEach((texels, level) => {
    const sides = size.map((side, axis) => (axis < 2 ? Math.max(1, side >> level) : side));
    gl[`texImage${size.length}D`](target, level, internal, ...sides, 0, ...inMemory, texels);
  });
  if (mips) gl.generateMipmap(target);
  for (const [option, value] of Object.entries(options)) gl.texParameteri(target, gl[option], gl[value]);
  const filtering = anisotropy && gl.getExtension("EXT_texture_filter_anisotropic");
  if (filtering) {
    const most = gl.getParameter(filtering.MAX_TEXTURE_MAX_ANISOTROPY_EXT);
    gl.texParameterf(target, filtering.TEXTURE_MAX_ANISOTROPY_EXT, Math.min(anisotropy, most));
  }
  return { target, texture };
}

// Bring `Texels` to the graphics card, all or the rows that changed, and return their texture, which may be there.
export function uploaded(gl, { array, changes, width }, description, onCard) {
  const numbers = ROW * width;
  const size = [ROW, array.length / numbers];
  const rows = [...changes];
  changes.clear();
  if (onCard?.array !== array) {
    if (size[1] > gl.getParameter(gl.MAX_TEXTURE_SIZE)) throw new Error("this device has no room for decals");
    return { ...makeTexture(gl, { ...description, size }, [array], onCard?.texture), array };
  }
  const inMemory = description.format.slice(1).map((word) => gl[word]);
  gl.bindTexture(gl.TEXTURE_2D, onCard.texture);
  for (const row of rows)
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, row, ROW, 1, ...inMemory, array, row * numbers);
  return onCard;
}

// Make a target of drawing with textures and a depth buffer; or give one another size.
export function makeTarget(gl, size, descriptions, before = {}) {
  const { framebuffer = gl.createFramebuffer(), depth = gl.createRenderbuffer() } = before;
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
  gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, ...size);
  gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
  const textures = descriptions.map((description, i) => {
    const made = makeTexture(gl, { ...description, size }, [null], before.textures?.[i].texture);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, made.target, made.texture, 0);
    return made;
  });
  gl.drawBuffers(textures.map((_, i) => gl.COLOR_ATTACHMENT0 + i));
  return { framebuffer, depth, textures, size };
}
