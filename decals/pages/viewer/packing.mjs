// The data of a page: base64 of zlib; inside, a JSON header and arrays whose bytes are sorted by their place.

const KINDS = {
  float32: Float32Array,
  int32: Int32Array,
  int16: Int16Array,
  float16: Uint16Array,
  uint8: Uint8Array,
};

export function fromBase64(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}

export function toBase64(bytes) {
  let text = "";
  for (let first = 0; first < bytes.length; first += 8192) {
    text += String.fromCharCode(...bytes.subarray(first, first + 8192));
  }
  return btoa(text);
}

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Return the header and its arrays by name.
export async function unpacked(text) {
  const bytes = await inflated(fromBase64(text));
  const size = new DataView(bytes.buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + size)));
  const arrays = {};
  let first = 4 + size;
  for (const { name, like, kind, count, width, differences } of header.arrays) {
    if (like !== undefined) {
      arrays[name] = arrays[like];
      continue;
    }
    const array = new KINDS[kind](count);
    const target = new Uint8Array(array.buffer);
    const rows = target.length / width;
    for (let place = 0; place < width; place++) {
      for (let i = 0; i < rows; i++) target[i * width + place] = bytes[first + place * rows + i];
    }
    if (differences) for (let i = 1; i < count; i++) array[i] += array[i - 1];
    arrays[name] = array;
    first += target.length;
  }
  return { header, arrays };
}
