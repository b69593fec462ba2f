// WebGL 2: programs that take their uniforms by name, textures, and targets of drawing.
import { ROW } from "./texels.mjs";

// Formats of textures: those of their texels in memory.
const FORMATS = {
  RGBA32F: ["RGBA", "FLOAT"],
  RGBA16F: ["RGBA", "HALF_FLOAT"],
  RGB16F: ["RGB", "HALF_FLOAT"],
  SRGB8_ALPHA8: ["RGBA", "UNSIGNED_BYTE"],
  RGBA32I: ["RGBA_INTEGER", "INT"],
  R32I: ["RED_INTEGER", "INT"],
};
const PLAIN = { kind: "2D", filter: ["NEAREST", "NEAREST"], wrap: ["CLAMP_TO_EDGE", "CLAMP_TO_EDGE"] };

export class Program {
  constructor(gl, vertex, fragment) {
    const program = gl.createProgram();
    for (const [kind, text] of Object.entries({ VERTEX_SHADER: vertex, FRAGMENT_SHADER: fragment })) {
      const shader = gl.createShader(gl[kind]);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      const logs = gl.getAttachedShaders(program).map((shader) => gl.getShaderInfoLog(shader));
      throw new Error(`this device refuses a shader: ${[gl.getProgramInfoLog(program), ...logs].join(" ")}`);
    }
    Object.assign(this, { gl, program });
  }

  // Use the program with the values of its uniforms: a texture's name, or the ending and the arguments of `uniform…`.
  use(values, textures) {
    const { gl, program } = this;
    gl.useProgram(program);
    let unit = 0;
    for (const [name, value] of Object.entries(values)) {
      const place = gl.getUniformLocation(program, name);
      if (place && Array.isArray(value)) {
        gl[`uniform${value[0]}`](place, ...value.slice(1));
      } else if (place) {
        gl.activeTexture(gl.TEXTURE0 + unit);
        gl.bindTexture(textures[value].target, textures[value].texture);
        gl.uniform1i(place, unit++);
      }
    }
  }
}

// Make a texture of levels of texels, each half as large as the one before; null for a level without contents.
export function makeTexture(gl, description, levels) {
  const { kind, format, size, filter, wrap, mips, anisotropy } = { ...PLAIN, ...description };
  const target = gl[`TEXTURE_${kind}`];
  const texture = gl.createTexture();
  gl.bindTexture(target, texture);
  levels.forEach((texels, level) => {
    const sides = size.map((side, axis) => (axis < 2 ? Math.max(1, side >> level) : side));
    const inMemory = FORMATS[format].map((word) => gl[word]);
    gl[`texImage${size.length}D`](target, level, gl[format], ...sides, 0, ...inMemory, texels);
  });
  if (mips) gl.generateMipmap(target);
  ["MIN_FILTER", "MAG_FILTER", "WRAP_S", "WRAP_T"].forEach((option, i) => {
    gl.texParameteri(target, gl[`TEXTURE_${option}`], gl[[...filter, ...wrap][i]]);
  });
  const filtering = anisotropy && gl.getExtension("EXT_texture_filter_anisotropic");
  if (filtering) {
    const most = gl.getParameter(filtering.MAX_TEXTURE_MAX_ANISOTROPY_EXT);
    gl.texParameterf(target, filtering.TEXTURE_MAX_ANISOTROPY_EXT, Math.min(anisotropy, most));
  }
  return { target, texture };
}

// Bring `Texels` to the graphics card, all or what changed, and return their texture.
export function uploaded(gl, texels) {
  const { array, format, width, changes } = texels;
  const rows = array.length / (ROW * width);
  if (changes) {
    gl.bindTexture(gl.TEXTURE_2D, texels.onCard.texture);
    for (const row of changes) {
      const part = array.subarray(row * ROW * width, (row + 1) * ROW * width);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, row, ROW, 1, ...FORMATS[format].map((word) => gl[word]), part);
    }
  } else {
    if (rows > gl.getParameter(gl.MAX_TEXTURE_SIZE))
      throw new Error("there are too many decals for this device");
    gl.deleteTexture(texels.onCard?.texture ?? null);
    texels.onCard = makeTexture(gl, { format, size: [ROW, rows] }, [array]);
  }
  texels.changes = new Set();
  return texels.onCard;
}

// A target of drawing with textures of some formats, and with a depth buffer.
export function makeTarget(gl, size, formats) {
  const framebuffer = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  const places = formats.map((_, i) => gl.COLOR_ATTACHMENT0 + i);
  const textures = formats.map((format) => makeTexture(gl, { format, size }, [null]));
  textures.forEach(({ target, texture }, i) => {
    gl.framebufferTexture2D(gl.FRAMEBUFFER, places[i], target, texture, 0);
  });
  gl.drawBuffers(places);
  const depth = gl.createRenderbuffer();
  gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
  gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, ...size);
  gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
  const release = () => {
    textures.forEach(({ texture }) => gl.deleteTexture(texture));
    gl.deleteRenderbuffer(depth);
    gl.deleteFramebuffer(framebuffer);
  };
  return { framebuffer, textures, release };
}
