// What stands around the picture (controls.html): buttons with their keys, the contact mode, and a line of text.

export class Controls {
  constructor(root, { markup, controls }, viewer) {
    root.classList.add("decal-viewer");
    root.innerHTML = markup;
    const [canvas, outline, bar, mode, stiffness, status] = [
      ...["canvas", "polygon", ".bar", "select", "input", "[role=status]"].map((part) =>
        root.querySelector(part),
      ),
    ];
    Object.assign(this, { root, canvas, outline, mode, stiffness, status });
    this.buttons = Array.from(bar.querySelectorAll("button"));
    for (const button of this.buttons) {
      button.setAttribute("aria-label", button.title);
      button.addEventListener("click", () => viewer.run(button.name));
    }
    bar.hidden = !controls;
    mode.addEventListener("change", () => viewer.set({ mode: mode.value }));
    stiffness.addEventListener("input", () => viewer.set({ stiffness: Number(stiffness.value) }));
    root.addEventListener("keydown", (event) => this.press(event, viewer));
  }

  // Run the command of a key: that of an enabled button, or one without a button.
  press(event, viewer) {
    if (event.target.matches("select, input")) return; // these have keys of their own
    const control = event.ctrlKey || event.metaKey ? `control+${event.shiftKey ? "shift+" : ""}` : "";
    const key = control + event.key.toLowerCase();
    const button = this.buttons.find((one) => !one.disabled && one.dataset.keys.split(" ").includes(key));
    if (viewer.run(button?.name ?? key)) event.preventDefault();
  }

  // Show the state: what can be done, and the rim of the selected decal as points of the picture.
  show({ mode, stiffness, selected, history }, rim) {
    this.mode.value = mode;
    this.stiffness.value = stiffness;
    this.stiffness.disabled = mode !== "elastic";
    const off = { undo: !history.done.length, redo: !history.undone.length };
    for (const button of this.buttons)
      button.disabled = off[button.name] ?? ("selected" in button.dataset && selected < 0);
    this.outline.setAttribute("points", rim.map((point) => point.join(",")).join(" "));
  }

  say(text) {
    this.status.textContent = text;
  }
}
