// The data of a page: base64 of zlib; inside, a JSON header and arrays whose bytes are sorted by their place.

// Return the header and its arrays by name.
export async function unpacked(text) {
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const size = new DataView(bytes.buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + size)));
  const arrays = {};
  let first = 4 + size;
  for (const { names, kind, count, width, differences } of header.arrays) {
    const array = new globalThis[`${kind}Array`](count);
    const target = new Uint8Array(array.buffer);
    const rows = target.length / width;
    for (let place = 0; place < width; place++)
      for (let i = 0; i < rows; i++) target[i * width + place] = bytes[first + place * rows + i];
    if (differences) for (let i = 1; i < count; i++) array[i] += array[i - 1];
    for (const name of names) arrays[name] = array;
    first += target.length;
  }
  return { header, arrays };
}
