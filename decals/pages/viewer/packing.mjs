// The data of a page: base64 of zlib; inside, a JSON header and arrays whose bytes are sorted by their place.

export function fromBase64(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}

export function toBase64(bytes) {
  return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
}

// Return the header and its arrays by name.
export async function unpacked(text) {
  const stream = new Blob([fromBase64(text)]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const size = new DataView(bytes.buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + size)));
  const arrays = {};
  let first = 4 + size;
  for (const { name, like, kind, count, width, differences } of header.arrays) {
    if (like !== undefined) {
      arrays[name] = arrays[like];
      continue;
    }
    const array = new globalThis[`${kind}Array`](count);
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
