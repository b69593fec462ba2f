// Scores of puzzles, of which the browser keeps the least, and links to puzzles.

// Return the least score of a key, Infinity without any. The given score counts too, unless it is null.
export function best(key, score) {
  let least = score ?? Infinity;
  try {
    least = Math.min(least, Number(localStorage.getItem(key) ?? Infinity));
    if (Number.isFinite(least)) localStorage.setItem(key, least);
  } catch {
    // the browser keeps nothing for this page, as in some frames
  }
  return least;
}

// Copy a text: browsers have a clipboard on this machine and by https, and may refuse it.
export function copy(text) {
  navigator.clipboard?.writeText(text).catch(() => {});
}

// Copy the address of this page with a text behind it, and return it.
export function copyAddress(text) {
  const link = `${location.href.split("#")[0]}#${text}`;
  copy(link);
  return link;
}
