// What stands around the picture (controls.html): buttons with their keys, the contact mode, and a line of text.
import { copyLink, save } from "./files.mjs";
import { turned } from "./vectors.mjs";

const TURN = Math.PI / 12; // of a decal, at a press
const SCALE = 1.1; // of a decal and of the camera's distance, at a press

// What buttons and keys do, by the names of the buttons and of the keys without one.
const COMMANDS = {
  undo: (viewer) => viewer.history.go(-1),
  redo: (viewer) => viewer.history.go(1),
  add: (viewer) => viewer.addAt(0, 0),
  remove: (viewer) => viewer.edit([[viewer.selected, null]]),
  left: (viewer) => viewer.editSelected((row) => ({ tangent: turned(row.tangent, row.normal, TURN) })),
  right: (viewer) => viewer.editSelected((row) => ({ tangent: turned(row.tangent, row.normal, -TURN) })),
  smaller: (viewer) => viewer.editSelected(({ radius }) => ({ radius: radius / SCALE })),
  larger: (viewer) => viewer.editSelected(({ radius }) => ({ radius: radius * SCALE })),
  home: (viewer) => viewer.set({ camera: viewer.camera.home }),
  link: copyLink,
  save,
  n: (viewer) => viewer.select(1),
  p: (viewer) => viewer.select(-1),
  escape: (viewer) => viewer.set({ selected: -1 }),
  arrowleft: (viewer) => viewer.arrow(-1, 0),
  arrowright: (viewer) => viewer.arrow(1, 0),
  arrowup: (viewer) => viewer.arrow(0, 1),
  arrowdown: (viewer) => viewer.arrow(0, -1),
  "+": (viewer) => viewer.moveCamera("zoom", 1 / SCALE),
  "-": (viewer) => viewer.moveCamera("zoom", SCALE),
};

export class Controls {
  constructor(root, { markup, controls }, viewer) {
    root.classList.add("decal-viewer");
    root.innerHTML = markup;
    const [canvas, bar, status] = root.children;
    const [mode, stiffness] = bar.querySelectorAll("select, input");
    Object.assign(this, { root, canvas, status, mode, stiffness, buttons: bar.querySelectorAll("button") });
    bar.hidden = !controls;
    bar.addEventListener("click", ({ target }) => COMMANDS[target.name]?.(viewer));
    const chosen = ({ name, value }) => ({ [name]: name === "stiffness" ? 2 ** value : value });
    bar.addEventListener("input", ({ target }) => viewer.set(chosen(target)));
    for (const part of [canvas, bar]) part.addEventListener("keydown", (event) => this.press(event, viewer));
  }

  // Run the command of a key: that of an enabled button, or one without a button.
  press(event, viewer) {
    if (event.altKey || event.target.matches("select, input")) return; // keys of the browser, and of these
    const control = event.ctrlKey || event.metaKey ? `control+${event.shiftKey ? "shift+" : ""}` : "";
    const key = control + event.key.toLowerCase().replace("=", "+");
    const button = this.root.querySelector(`button[data-keys~="${CSS.escape(key)}"]:enabled`);
    const command = COMMANDS[button?.name ?? key];
    if (command) event.preventDefault();
    command?.(viewer);
  }

  // Show the state, and what can be done.
  show({ mode, stiffness, selected, history }) {
    this.mode.value = mode;
    Object.assign(this.stiffness, { value: Math.log2(stiffness), disabled: mode !== "elastic" });
    this.stiffness.ariaValueText = stiffness.toPrecision(2);
    const can = { undo: history.at > 0, redo: history.at + 1 < history.states.length, change: selected >= 0 };
    for (const button of this.buttons) button.disabled = can[button.dataset.needs] === false;
    const { activeElement } = this.root.getRootNode(); // a window without the focus has no `:focus`
    if (activeElement?.disabled && this.root.contains(activeElement)) this.canvas.focus(); // else keys reach nothing
  }

  say(text) {
    this.status.textContent = text;
  }
}
