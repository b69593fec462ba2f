// What leaves a page: a link to its state, and its scene as a file.

const READING = 60_000; // milliseconds in which a browser begins to read a file
const TOO_MANY = "So many decals have changed that no link can hold them: save a scene file.";
const NOWHERE = "A page inside a notebook has no link of its own: save a scene file.";

// Why a state has no link; empty if it has one.
const refusal = ({ link }) => (link === null ? TOO_MANY : location.protocol === "about:" ? NOWHERE : "");

// Keep a state in the address; only if a file is needed instead, say so where nothing else is said.
export function keepLink({ controls }, state) {
  if (!refusal(state)) history.replaceState(null, "", `#${state.link}`);
  else if (refusal(state) === TOO_MANY && !controls.status.textContent) controls.say(TOO_MANY);
}

export function copyLink(viewer) {
  const [{ controls }, state] = [viewer, viewer.get()];
  keepLink(viewer, state);
  controls.say(refusal(state) || "The link of this state is in the address bar.");
  const sayBoth = () => controls.say("The link of this state is in the address bar and in the clipboard.");
  if (!refusal(state)) navigator.clipboard?.writeText(location.href).then(sayBoth, () => {}); // may be refused
}

// The scene as a file that `decals.load_scene` takes.
export function sceneText({ header: { scene }, arrays, mode, stiffness, camera: { pose, home }, decals }) {
  const text = (name) =>
    btoa(Array.from(new Uint8Array(arrays[name].buffer), (byte) => String.fromCharCode(byte)).join(""));
  const data = (i) => ({ vertices: text(`vertices of ${i}`), faces: text(`faces of ${i}`) });
  const objects = scene.objects.map((item, i) => (item.type === "mesh" ? { ...item, data: data(i) } : item));
  const drawing = { ...scene.drawing, contact: mode, stiffness };
  const moved = pose.position !== home.position && { ...pose, aspect: undefined, fit: undefined };
  const rows = decals.rows.filter((row) => row);
  return JSON.stringify({ ...scene, objects, drawing, camera: { ...scene.camera, ...moved }, decals: rows });
}

export function save(viewer) {
  const href = URL.createObjectURL(new Blob([sceneText(viewer)], { type: "application/json" }));
  Object.assign(document.createElement("a"), { href, download: "scene.json" }).click();
  setTimeout(() => URL.revokeObjectURL(href), READING); // Firefox reads it later
  viewer.controls.say("The scene is saved as scene.json.");
}
