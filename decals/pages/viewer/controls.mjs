// What stands around the picture: buttons, the contact mode, stiffness, help, and a line that says what happened.

const BUTTONS = [
  ["undo", "↶", "Undo (Ctrl + Z)"],
  ["redo", "↷", "Redo (Ctrl + Y)"],
  ["add", "Add", "Add a decal in the middle of the picture (A)"],
  ["remove", "✕", "Delete the decal (Delete)"],
  ["left", "⟲", "Turn the decal to the left (Q)"],
  ["right", "⟳", "Turn the decal to the right (E)"],
  ["smaller", "−", "Make the decal smaller (−)"],
  ["larger", "+", "Make the decal larger (+)"],
  ["home", "⌂", "Show the whole model (Home)"],
  ["link", "Link", "Copy a link to this state (L)"],
  ["save", "⤓", "Save as a scene file (S)"],
];

const HELP = `<details><summary>Help</summary><p>Drag a decal to move it, and the background or bare surface to
turn the model. Two fingers, or the wheel, zoom; the right button or Shift moves the picture. Keys: N and P select the
next and the previous decal, arrow keys move it (or turn the model if none is selected), Q and E turn it, + and −
scale it, A adds one, Delete deletes it, Escape ends the selection, Ctrl + Z undoes.</p></details>`;

export class Controls {
  constructor(root, { title, alt, modes, controls, background }, commands) {
    root.classList.add("decal-viewer");
    root.innerHTML = `<canvas tabindex="0" role="application" aria-roledescription="3D picture"></canvas>
      <svg aria-hidden="true"><polygon></polygon></svg>
      <div class="bar" role="toolbar">${BUTTONS.map(button).join("")}
      <label>Contact <select name="mode">${modes.map((mode) => `<option>${mode}</option>`).join("")}</select></label>
      <label>Stiffness <input name="stiffness" type="range" min="1" max="8" step="0.1"></label>${HELP}</div>
      <p role="status"></p>`;
    this.root = root;
    this.canvas = root.querySelector("canvas");
    this.canvas.setAttribute("aria-label", alt);
    const [top, bottom] = [background.top, background.bottom].map(css);
    this.canvas.style.background = `linear-gradient(${top}, ${bottom})`;
    this.bar = root.querySelector(".bar");
    this.bar.setAttribute("aria-label", `Tools of ${title}`);
    this.bar.hidden = !controls;
    this.outline = root.querySelector("polygon");
    this.mode = root.querySelector("select");
    this.stiffness = root.querySelector("input");
    this.status = root.querySelector("[role=status]");
    this.bar.addEventListener("click", ({ target }) => {
      const name = target.closest("button")?.name;
      if (name) commands.run(name);
    });
    this.mode.addEventListener("change", () => commands.set({ mode: this.mode.value }));
    this.stiffness.addEventListener("input", () => commands.set({ stiffness: Number(this.stiffness.value) }));
  }

  // Show the state: what can be done, and the rim of the selected decal as points of the picture.
  show({ mode, stiffness, selected, canUndo, canRedo, stiff }, rim) {
    this.mode.value = mode;
    this.stiffness.value = stiffness;
    this.stiffness.disabled = !stiff;
    const off = { undo: !canUndo, redo: !canRedo };
    for (const name of ["remove", "left", "right", "smaller", "larger"]) off[name] = selected < 0;
    for (const button of this.bar.querySelectorAll("button")) button.disabled = off[button.name] ?? false;
    this.outline.setAttribute("points", rim.map((point) => point.join(",")).join(" "));
  }

  say(text) {
    this.status.textContent = text;
  }
}

function button([name, sign, label]) {
  return `<button type="button" name="${name}" title="${label}" aria-label="${label}">${sign}</button>`;
}

function css([red, green, blue, alpha]) {
  const percent = [red, green, blue].map((level) => `${100 * level}%`);
  return `rgb(${percent.join(" ")} / ${alpha})`;
}
