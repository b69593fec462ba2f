// What the sandbox's page does in the browser. Its templates call these functions as `utils.sandbox`.
(() => {
  const { trame } = window;

  // trame's page fetches the text "Loading..." and writes it into the app, even after the app is there. This keeps it out.
  Object.defineProperty(document.querySelector("#app"), "innerHTML", { set() {} });

  // The connection ends with the page, which is no error.
  window.addEventListener("pagehide", () => {
    window.addEventListener("unhandledrejection", (event) => event.preventDefault());
  });

  // Return where the middle of two fingers is, and how far apart they are, in heights of the view.
  const fingersOf = (event) => {
    const [a, b] = event.touches;
    const height = event.currentTarget.clientHeight;
    const distance = Math.max(Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY), 1);
    return [(a.clientX + b.clientX) / 2 / height, (a.clientY + b.clientY) / 2 / height, distance / height];
  };

  // Return true for the key of a node below that of another node or of an object.
  const isBelow = (key, top) =>
    top.startsWith("object ") ? `${key}/`.startsWith(`${top.slice(7)}/`) : key.startsWith(`${top}/`);

  // Return true for a layer that is dropped on another one, or an object near the edge of another one's row.
  const sorts = ({ currentTarget, clientY }, dragged, key) => {
    const [kind, other] = [dragged, key].map((one) => one.split(" ")[0]);
    const { top, height } = currentTarget.getBoundingClientRect();
    const edge = Math.abs((clientY - top) / height - 0.5) > 0.25;
    return kind === other && (kind === "layer" || (kind === "object" && edge));
  };

  const HOVER_MS = 60;
  const DRAG_PIXELS = 6; // from which on a press is a drag
  const MENU_MS = 50; // until a menu is drawn
  const MENU_TRIES = 40; // looks at a menu that closes
  const FIELD = ".v-overlay--active .v-sheet input";
  const hovering = { key: "", told: null };

  trame.utils.sandbox = {
    // Two fingers turn and zoom the view, three move it; the first does what the mouse does, until others come.
    touchstart(event) {
      if (event.touches.length > 1) {
        if (event.currentTarget.placed) event.currentTarget.placed = true; // another press may place it
        event.currentTarget.fingers = fingersOf(event);
        trame.trigger("pinch", [0, 0, 1, "begin"]);
      }
    },
    touchmove(event) {
      const count = event.touches.length;
      if (count > 1) {
        const last = event.currentTarget.fingers;
        const now = (event.currentTarget.fingers = fingersOf(event));
        if (last) {
          trame.trigger("pinch", [now[0] - last[0], last[1] - now[1], now[2] / last[2], "move", count]);
        }
      }
    },
    touchend(event) {
      if (event.touches.length > 1) event.currentTarget.fingers = fingersOf(event);
      else if (event.currentTarget.fingers) trame.trigger("pinch", [0, 0, 1, "end"]);
    },
    pointerdown(event) {
      const kind = trame.state.get("placing");
      if (kind && event.isPrimary && !event.target.closest("button")) {
        event.stopPropagation();
        event.preventDefault();
        event.currentTarget.setPointerCapture(event.pointerId);
        event.currentTarget.placed = { kind, place: this.place(event), x: event.clientX, y: event.clientY };
      } else if (event.isPrimary) event.currentTarget.fingers = event.currentTarget.placed = null;
      else event.stopPropagation();
    },
    // The circle of the brush follows the pointer.
    pointermove(event) {
      const view = event.currentTarget;
      const box = view.getBoundingClientRect();
      if (view.fingers) event.stopPropagation();
      const kind = trame.state.get("placing");
      const place = event.buttons ? "" : this.place(event);
      const { placed } = view;
      if (placed?.kind) this.hover(`kind ${kind} ${placed.place} ${this.edge(event)}`.trim());
      else this.hover(kind && place ? `kind ${kind} ${place}` : place, event);
      view.style.setProperty("--x", `${event.clientX - box.left}px`);
      view.style.setProperty("--y", `${event.clientY - box.top}px`);
    },
    pointerup(event) {
      const { placed } = event.currentTarget;
      if (!event.isPrimary || placed) event.stopPropagation();
      if (!event.isPrimary || !placed?.kind) return;
      trame.trigger("add_at", [placed.kind, placed.place, this.edge(event)]);
      this.leave(event);
    },
    // Return the place to which the shape that is being placed is dragged, "" for a click.
    edge(event) {
      const { x, y } = event.currentTarget.placed;
      return Math.hypot(event.clientX - x, event.clientY - y) < DRAG_PIXELS ? "" : this.place(event);
    },

    // Leave the placing of a new part; the press that places it does nothing else.
    leave(event) {
      event.stopPropagation();
      event.preventDefault();
      document.querySelector("[role=application]").placed = true;
      trame.state.set("placing", "");
      this.hover("");
    },

    // Send a phase of a drag of a handle, and the pointer's place.
    drag(event, name, phase) {
      const box = event.target.ownerSVGElement.getBoundingClientRect();
      const x = (event.clientX - box.left) / box.width;
      const y = (event.clientY - box.top) / box.height;
      trame.trigger("drag_handle", [name, phase, x, y, event.ctrlKey || event.metaKey]);
    },

    // Send the row or the place of the view at which the pointer is, the newest one only.
    async hover(key, event) {
      hovering.key = event?.pointerType === "touch" ? "" : key;
      if (hovering.told !== null) return;
      while (hovering.told !== hovering.key) {
        hovering.told = hovering.key;
        await trame.trigger("hover", [hovering.told]);
        await new Promise((done) => setTimeout(done, HOVER_MS));
      }
      hovering.told = null;
    },
    // Return true for a row that lights up, and for a folded one above it.
    lit(row, keys, folded) {
      return keys.some((key) => key === row.key || (folded.includes(row.key) && isBelow(key, row.key)));
    },

    // Return the key of the place of the pointer in the view.
    place(event) {
      const box = event.currentTarget.getBoundingClientRect();
      const steps = (share) => Math.round(10000 * share);
      return `view ${steps((event.clientX - box.left) / box.width)}/${steps((box.bottom - event.clientY) / box.height)}`;
    },

    // Send files that were chosen or dropped, or the key of a row that was dropped on another or on the view.
    take(event, key = "") {
      event.preventDefault();
      const source = event.dataTransfer ?? event.target;
      if (source.files.length) {
        trame.state.set("dropped_on", key);
        trame.state.set("dropped", Array.from(source.files));
        if (source === event.target) source.value = ""; // so that the same file can be chosen again
      } else if (key) {
        const dragged = source.getData("text/plain");
        const change = sorts(event, dragged, key) ? "reorder" : "move";
        if (key.startsWith("view ")) trame.trigger("place_image", [dragged, key]);
        else trame.trigger("change_row", [dragged, change, key]);
      }
    },

    // Save a file of the server's folder, which comes in parts, as the browser saves files.
    async download(name) {
      const parts = [];
      let size = 0;
      for (;;) {
        const part = await trame.trigger("read_file", [name, size]);
        if (!part?.byteLength) break;
        parts.push(part);
        size += part.byteLength;
      }
      if (size) trame.utils.download(name.trim().split("/").pop(), new Blob(parts));
    },

    // A menu of kinds focuses its search field, and its button again when it closes. Its ghost goes with it.
    async menu(open) {
      if (open) this.opener = document.activeElement;
      await new Promise((drawn) => setTimeout(drawn, MENU_MS));
      if (open && matchMedia("(pointer: fine)").matches) document.querySelector(FIELD)?.focus();
      if (open) return;
      trame.state.set("kind_sought", "");
      // Firefox leaves the focus in what is hidden, which may happen late.
      const isHidden = () => !document.activeElement.checkVisibility();
      for (let i = 0; i < MENU_TRIES && document.activeElement.closest(".v-overlay") && !isHidden(); i++) {
        await new Promise((hidden) => setTimeout(hidden, MENU_MS));
      }
      if (document.activeElement === document.body || isHidden()) this.opener?.focus();
      setTimeout(() => this.hover(""), MENU_MS);
    },
    // Return the kinds of a family whose name has what is sought, then those whose description or group has it.
    kinds({ docs, groups, ...families }, family, sought) {
      const found = families[family].filter((kind) =>
        this.found(`${kind} ${docs[kind]} ${groups[kind]}`, sought),
      );
      const named = found.filter((kind) => this.found(kind, sought));
      return [...named, ...found.filter((kind) => !named.includes(kind))];
    },
    // Return the first kind below the field in which it is sought.
    firstKind({ target }) {
      return target.closest(".v-sheet").querySelector(".v-list-item");
    },
    // Return the rows of number fields of a control: what each shows, its label, and the indices that lead to it.
    numbers({ kind, value, label }) {
      const field = (number, index) => ({
        shown: typeof number === "number" ? Number(number.toPrecision(5)) : null,
        label: [label, ...index.map((i) => i + 1)].join(" "),
        index,
      });
      if (kind === "number" || kind === "field") return [[field(value, [])]];
      if (kind === "vector") return [value.map((number, i) => field(number, [i]))];
      if (kind !== "list") return [];
      return value.map((row, i) =>
        Array.isArray(row) ? row.map((number, j) => field(number, [i, j])) : [field(row, [i])],
      );
    },
    // Return true for a row that is found, or that lies below no folded row while nothing is sought.
    shown(row, folded, sought) {
      if (sought) return this.found(`${row.label} ${row.type}`, sought);
      return !folded.some((key) => isBelow(row.key, key));
    },
    // Call a function with the puzzle of the address if there is one, now and when the address changes.
    puzzles(call) {
      const play = () => location.hash.startsWith("#puzzle=") && call(location.hash.slice(1));
      addEventListener("hashchange", play);
      play();
    },
    // Return a score as a text, with a star at par.
    scored(score, par) {
      return Number.isFinite(score) ? `${Number(score.toPrecision(3))}${score <= par ? " ★" : ""}` : "–";
    },
    // Return true for a text that has what is sought, in large or small letters.
    found(text, sought) {
      return text.toLowerCase().includes((sought ?? "").trim().toLowerCase());
    },
    // Fold a row, or unfold it.
    fold(row, folded) {
      return folded.includes(row.key) ? folded.filter((key) => key !== row.key) : [...folded, row.key];
    },

    // Send the name in the field of a row, unless it is as before, and return the hidden field.
    rename(field, row) {
      if (field.key && field.name !== row.label) {
        trame.trigger("change_row", [field.key, "rename", field.name]);
      }
      return { key: "", name: "" };
    },
  };

  // Inputs in which one types: Escape and keys with Ctrl act on their text.
  const TYPED =
    "input:not([type=range], [type=color], [type=checkbox], [type=file], [role=combobox]), textarea";

  // Keys with Ctrl act from everywhere as in the view; in a field, only the one that saves, after the field's change.
  document.addEventListener("keydown", (event) => {
    const { key, ctrlKey, metaKey, shiftKey, target } = event;
    const view = document.querySelector("[role=application]");
    const typing = target.matches(TYPED);
    const keys = typing ? "s" : view.dataset.ctrlKeys;
    if (!(ctrlKey || metaKey) || view.contains(target) || !keys.includes(key.toLowerCase())) return;
    event.preventDefault();
    if (typing) target.blur();
    if (/^[ei]$/i.test(key) || (shiftKey && /^s$/i.test(key))) view.focus({ preventScroll: true });
    view.dispatchEvent(new KeyboardEvent("keydown", { key, ctrlKey, metaKey, shiftKey }));
  });

  // One key changes the colours of the page from everywhere.
  document.addEventListener(
    "keydown",
    (event) => {
      if (!event.altKey || event.code !== "KeyL") return;
      event.preventDefault();
      event.stopPropagation();
      trame.state.set("theme", trame.state.get("theme") === "light" ? "dark" : "light");
    },
    true,
  );

  // A press elsewhere takes what is being typed, before anything else follows from it. Escape drops it.
  const typedIn = () => document.activeElement?.closest(TYPED);
  document.addEventListener("change", ({ target }) => (target.taken = true), true);
  ["input", "focusin"].forEach((name) => {
    document.addEventListener(name, ({ target }) => (target.taken = false), true);
  });
  document.addEventListener(
    "pointerdown",
    (event) => {
      const field = typedIn();
      if (field && !field.contains(event.target)) field.blur();
    },
    true,
  );
  document.addEventListener(
    "keydown",
    (event) => {
      const field = typedIn();
      const value = field?.closest("[data-value]")?.dataset.value;
      if (event.key !== "Escape" || value === undefined) return;
      if (field.value === value) {
        field.blur(); // nothing is typed
        return;
      }
      event.stopPropagation();
      field.value = value;
      field.dispatchEvent(new Event("input", { bubbles: true }));
    },
    true,
  );

  // Escape ends from everywhere what it ends in the view, unless something on the page takes it.
  const OPEN = ".v-overlay--active:not(.v-tooltip)";
  document.addEventListener(
    "keydown",
    (event) => {
      const view = document.querySelector("[role=application]");
      const taken = event.defaultPrevented || typedIn() || document.querySelector(OPEN);
      if (event.key === "Escape" && !taken && trame.state.get("placing")) {
        trame.utils.sandbox.leave(event);
      } else if (event.key === "Escape" && document.querySelector(OPEN) && view.contains(event.target)) {
        event.stopPropagation(); // what is open closes, and the view keeps what it does
        window.dispatchEvent(new KeyboardEvent("keydown", { key: "Escape" }));
      } else if (event.key === "Escape" && !taken && !view.contains(event.target)) {
        view.dispatchEvent(new KeyboardEvent("keydown", { key: "Escape" }));
      }
    },
    true,
  );

  // Of the toolbar and of the outline, Tab reaches one button, the selected row; arrows lead from it to the others.
  // If the button with the focus is removed, the next one gets the focus.
  const BUTTONS = "button, [role=button]";
  const reachedOf = (group) =>
    (!group.contains(document.activeElement) && group.querySelector(".v-list-item--active")) || group.reached;
  const rove = (group, reached = reachedOf(group)) => {
    const buttons = [...group.querySelectorAll(BUTTONS)];
    group.reached = buttons.includes(reached)
      ? reached
      : buttons[Math.min(group.place ?? 0, buttons.length - 1)];
    group.place = buttons.indexOf(group.reached);
    buttons.forEach((button) => (button.tabIndex = button === group.reached ? 0 : -1));
    return buttons;
  };
  const focused = { button: null, group: null };
  const keepFocus = (button, group) => Object.assign(focused, { button, group });
  document.addEventListener("focusin", ({ target }) => {
    const group = target.matches(BUTTONS) ? target.closest("[data-roving]") : null;
    if (group) rove(group, target);
    keepFocus(target, group);
  });
  document.addEventListener("pointerdown", () => keepFocus(null, null), true);
  document.addEventListener(
    "keydown",
    (event) => {
      const { key, target } = event;
      const group = target.matches(BUTTONS) && target.closest("[data-roving]");
      const sideways = { ArrowLeft: -1, ArrowRight: 1 }[key];
      const step = sideways ?? { ArrowUp: -1, ArrowDown: 1 }[key];
      if (!group || !step) return;
      const buttons = rove(group).filter((one) => sideways || one === target || one.matches("[role=button]"));
      const next = buttons[buttons.indexOf(target) + step];
      if (!next) return;
      event.preventDefault();
      event.stopPropagation();
      next.focus();
    },
    true,
  );

  // Chromium holds moves of the pointer back until its next frame. While a button is down, the view gets a move at once
  // if the last one is a frame old. The same move, which comes again with the frame, is dropped.
  const FRAME_MS = 16;
  const moved = { time: 0, x: 0, y: 0 };
  const note = ({ timeStamp: time, clientX: x, clientY: y }) => Object.assign(moved, { time, x, y });
  document.addEventListener("pointerrawupdate", (event) => {
    const late = event.timeStamp - moved.time >= FRAME_MS;
    if (!late || !event.buttons || !event.isPrimary || !event.target.closest("[role=application]")) return;
    note(event);
    event.target.dispatchEvent(new PointerEvent("pointermove", event));
  });
  document.addEventListener(
    "pointermove",
    (event) => {
      if (!event.isTrusted || !event.isPrimary) return;
      if (event.buttons && event.clientX === moved.x && event.clientY === moved.y) event.stopPropagation();
      else note(event);
    },
    true,
  );

  // The page begins in the colours of the system, once its templates follow the state.
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  setTimeout(() => dark && trame.state.set("theme", "dark"));

  // A session that has ended opens again once the server answers.
  const reopen = async (message) => {
    const answer = await fetch("./").catch(() => null);
    if (answer?.ok) location.reload();
    else setTimeout(reopen, 2000, message);
    if (answer?.status === 403) message.textContent = CLOSED;
  };
  const CLOSED = "The server has started anew. Open the address that the terminal shows.";
  const ENDED =
    "The session has ended. Unsaved changes are kept. This page opens them once the server answers.";
  const explainEnd = () => {
    const message = document.querySelector(".trame__message");
    if (message?.textContent.trim() !== "Connection closed") return;
    message.textContent = ENDED;
    reopen(message);
  };

  // The view shows an image without the text that screen readers ask for, and Tab reaches the view once, not what
  // trame puts into it; new buttons join their group.
  const complete = () => {
    explainEnd();
    document.querySelectorAll("[role=application] [tabindex='0']").forEach((inner) => (inner.tabIndex = -1));
    document.querySelectorAll("img:not([alt])").forEach((image) => (image.alt = ""));
    document.querySelectorAll("[data-roving]").forEach((group) => rove(group));
    if (focused.group && !focused.button.isConnected) focused.group.reached?.focus();
  };
  new MutationObserver(complete).observe(document, { childList: true, subtree: true });
})();
