// Puzzles: sizes of decals and pars from the address, and scores.
import { best, copyAddress } from "../sandbox/scores.mjs";

// The puzzle of an address, or that of the lesson.
export function puzzleOf(fragment, { rows, scores, size }) {
  const given = new URLSearchParams(fragment.slice(1));
  const [radii, pars] = ["puzzle", "par"].map((name) => (given.get(name) ?? "").split(",").map(Number));
  const fits = radii.length === rows.length && pars.length === scores.length;
  if (fits && radii.every((radius) => radius > 0 && radius <= size) && pars.every(Number.isFinite))
    return { radii, pars };
  return { radii: rows.map(({ radius }) => radius), pars: scores.map(({ par }) => par) };
}

// Show the scores of a page, with the pars if its decals have the sizes of the puzzle.
export function showScores(page, counts) {
  const { lesson, live, puzzle } = page;
  const { say } = page.measures;
  const sizesOf = (radii) => radii.map((radius) => Number(radius?.toPrecision(4))).join(",");
  const sizes = sizesOf(page.viewer.decals.rows.map((row) => row?.radius));
  const isOwn = sizes === sizesOf(puzzle.radii);
  const values = live.scores.map((score) => page.value(score));
  page.all(".scores tbody tr").forEach((line, i) => {
    const key = `${lesson.name} puzzle=${sizes} ${lesson.scores[i].formula}`;
    const least = best(key, counts ? values[i] : null);
    const star = isOwn && least <= puzzle.pars[i] ? " ★" : "";
    const texts = [say(values[i]), isOwn ? say(puzzle.pars[i]) : "–", say(least) + star];
    texts.forEach((text, column) => (line.cells[column + 1].textContent = text));
  });
  page.shared = `puzzle=${sizes}&par=${values.map((value) => Math.ceil(10 * value) / 10).join(",")}`;
}

// Copy a link to the puzzle of the present sizes, whose pars are the present scores, and show it.
export function share(page) {
  const link = copyAddress(page.shared);
  Object.assign(page.root.querySelector(".shared a"), { href: link, textContent: link });
}
