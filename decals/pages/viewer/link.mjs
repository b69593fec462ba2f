// The state of a page as the fragment of a link: camera, contact mode, stiffness, and decals that changed.

export const LONGEST = 2000; // characters of a fragment

const number = (x) => String(Number(x.toPrecision(5)));
const numbers = (values) => values.map(number).join(",");

// Return the fragment, or null if it would be too long.
export function written(state, originals) {
  const fields = [`eye=${numbers(state.camera.position)}`, `at=${numbers(state.camera.target)}`];
  fields.push(`mode=${state.mode}`, `k=${number(state.stiffness)}`);
  const changed = state.decals.rows.flatMap((row, place) => {
    const before = originals[place] ?? null;
    if (row === before) return [];
    if (!row) return [`${place}x`];
    const parts = [...row.position, ...row.normal, ...row.tangent, row.radius];
    return [`${place}:${numbers(parts)}${before ? "" : `,${row.image ?? 0}`}`];
  });
  if (changed.length) fields.push(`d=${changed.join(";")}`);
  const text = fields.join("&");
  return text.length <= LONGEST ? text : null;
}

// Return the state of a fragment, as far as it is valid.
export function read(fragment, originals) {
  const fields = new URLSearchParams(fragment.replace(/^#/, ""));
  const values = (text, count) => {
    const found = (text ?? "").split(",").map(Number);
    return found.length >= count && found.every(Number.isFinite) ? found : null;
  };
  const state = { changes: [] };
  const [position, target] = [values(fields.get("eye"), 3), values(fields.get("at"), 3)];
  if (position && target) state.camera = { position: position.slice(0, 3), target: target.slice(0, 3) };
  if (fields.has("mode")) state.mode = fields.get("mode");
  if (Number(fields.get("k")) >= 1) state.stiffness = Number(fields.get("k"));
  for (const text of (fields.get("d") ?? "").split(";")) {
    const [, digits, kind, rest] = /^(\d{1,7})([:x])(.*)$/.exec(text) ?? [];
    if (digits === undefined) continue;
    const place = Number(digits);
    const parts = values(rest, 10);
    if (kind === "x" && originals[place]) state.changes.push([place, null]);
    if (kind === ":" && parts && parts[9] > 0 && place <= originals.length + LONGEST) {
      const [position, normal, tangent] = [parts.slice(0, 3), parts.slice(3, 6), parts.slice(6, 9)];
      const row = { ...originals[place], position, normal, tangent, radius: parts[9] };
      if (!originals[place]) row.image = parts[10] ?? 0;
      state.changes.push([place, row]);
    }
  }
  return state;
}
