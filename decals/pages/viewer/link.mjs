// The state of a page as the fragment of a link: camera, contact mode, stiffness, and decals that changed.

export const LONGEST = 2000; // characters of a fragment

const short = (x) => String(Number(x.toPrecision(5)));
const list = (values) => values.map(short).join(",");

// Return the fragment, or null if it would be too long.
export function written({ camera: { pose }, aspect, mode, stiffness, decals, originals }) {
  const changed = decals.rows.flatMap((row, place) => {
    const before = originals[place] ?? null;
    if (row === before) return [];
    if (!row) return [`${place}x`];
    const parts = [...row.position, ...row.normal, ...row.tangent, row.radius];
    return [`${place}:${list(before ? parts : [...parts, row.image ?? 0])}`];
  });
  const camera = `eye=${list(pose.position)}&at=${list(pose.target)}&aspect=${short(pose.aspect || aspect)}`;
  const view = `${camera}&mode=${mode}&k=${short(stiffness)}`;
  const text = changed.length ? `${view}&d=${changed.join(";")}` : view;
  return text.length <= LONGEST ? text : null;
}

// Return the state of a fragment for `set`, which refuses other modes, stiffnesses and decals than valid ones.
// Decals with rows that the fragment leaves out become as they were at first.
export function read(fragment, originals, rows = []) {
  const fields = new URLSearchParams(String(fragment).replace(/^#/, ""));
  const numbers = (text, count) => {
    const values = (text ?? "").split(",").map(Number);
    return values.length >= count && values.every(Number.isFinite) ? values : null;
  };
  const [eye, target] = ["eye", "at"].map((name) => numbers(fields.get(name), 3)?.slice(0, 3));
  const camera = eye && target && { position: eye, target, aspect: Number(fields.get("aspect") ?? NaN) };
  const decals = Object.fromEntries(rows.map((_, place) => [place, originals[place] ?? null]));
  for (const text of (fields.get("d") ?? "").split(";")) {
    const [, digits, parts] = /^(\d{1,7})(?:x|:(.*))$/.exec(text) ?? [];
    const [place, values] = [Number(digits), numbers(parts, 10)];
    if (originals[place] && parts === undefined) decals[place] = null;
    if (values?.[9] > 0 && place <= originals.length + LONGEST) {
      const [position, normal, tangent] = [0, 3, 6].map((first) => values.slice(first, first + 3));
      const base = originals[place] ?? { image: values[10] ?? 0 };
      decals[place] = { ...base, position, normal, tangent, radius: values[9] };
    }
  }
  return { camera, mode: fields.get("mode"), stiffness: fields.get("k"), decals };
}
