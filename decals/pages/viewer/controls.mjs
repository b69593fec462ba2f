// What stands around the picture (controls.html): buttons with their keys, the contact mode, and a line of text.

export class Controls {
  constructor(root, { markup, controls }, viewer) {
    root.classList.add("decal-viewer");
    root.innerHTML = markup;
    const [canvas, bar, mode, stiffness, status] = ["canvas", ".bar", "select", "input", "[role=status]"].map(
      (selector) => root.querySelector(selector),
    );
    Object.assign(this, { root, canvas, bar, mode, stiffness, status });
    this.buttons = Array.from(this.bar.querySelectorAll("button"));
    for (const button of this.buttons) {
      button.setAttribute("aria-label", button.title);
      button.addEventListener("click", () => viewer.run(button.name));
    }
    this.bar.hidden = !controls;
    this.mode.addEventListener("change", () => viewer.set({ mode: this.mode.value }));
    this.stiffness.addEventListener("input", () => viewer.set({ stiffness: Number(this.stiffness.value) }));
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

  // Show the state, and what can be done.
  show({ mode, stiffness, selected, history }) {
    this.mode.value = mode;
    this.stiffness.value = stiffness;
    this.stiffness.disabled = mode !== "elastic";
    const off = { undo: !history.done.length, redo: !history.undone.length };
    for (const button of this.buttons)
      button.disabled = off[button.name] ?? ("selected" in button.dataset && selected < 0);
  }

  say(text) {
    this.status.textContent = text;
  }
}
