// Sketches: an outline that one draws with the mouse or a finger, and how far it is from the truth.

const APART = 0.01; // least distance of two points of an outline, in widths of its pad

let kept = []; // corners of the outline that was drawn before the guess, in the units of its pad, downward

// Take an event of the pointer on an element with a pad, whose picture ends with the outline.
export function draw(event) {
  const pad = event.currentTarget;
  const picture = pad.querySelector("svg");
  if (event.type === "pointerdown") {
    event.preventDefault();
    pad.setPointerCapture(event.pointerId);
    pad.outline = [];
  }
  if (!pad.hasPointerCapture(event.pointerId)) return;
  const place = new DOMPoint(event.clientX, event.clientY).matrixTransform(picture.getScreenCTM().inverse());
  const [x, y] = pad.outline.at(-1) ?? [Infinity, 0];
  if (Math.hypot(place.x - x, place.y - y) < APART * picture.viewBox.baseVal.width) return;
  pad.outline.push([place.x, place.y]);
  picture.lastElementChild.setAttribute("points", pad.outline.join(" "));
}

// Keep the outline of a form that is sent, until the next one.
export function keep(form) {
  kept = form.querySelector(".pad")?.outline ?? [];
}

// Return true for a point in a polygon: a ray from it crosses the polygon an odd number of times.
function isInside(corners, x, y) {
  const crossed = corners.filter(([a, b], i) => {
    const [c, d] = corners.at(i - 1);
    return b > y !== d > y && x < ((c - a) * (y - b)) / (d - b) + a;
  });
  return crossed.length % 2 === 1;
}

// Compare the kept outline with what a function returns, the true cells of a square, row by row from the top. Returns
// the difference over the true area, and the parts of a picture of both in SVG; without an outline null.
export function compared(cellsOf, half, corners = kept) {
  if (corners.length < 3) return null;
  const cells = cellsOf();
  const side = Math.sqrt(cells.length);
  const size = (2 * half) / side;
  const place = (number) => (number + 0.5) * size - half;
  const wrong = cells.filter(
    (cell, i) => cell !== isInside(corners, place(i % side), place(Math.floor(i / side))),
  );
  const squares = cells.map((cell, i) => {
    const corner = [i % side, Math.floor(i / side)].map((number) => (number * size - half).toFixed(3));
    return cell ? `M${corner.join(" ")}h${size}v${size}h${-size}z` : "";
  });
  const area = cells.filter(Boolean).length;
  return {
    difference: wrong.length / area,
    parts: `<path d="${squares.join("")}"/><polygon points="${corners.join(" ")}"/>`,
  };
}
