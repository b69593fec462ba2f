// Show the data of this page.
addEventListener("hashchange", () => location.reload()); // another link was pasted
const [root, data] = ["viewer", "data"].map((name) => document.getElementById(name));
const options = { link: location.hash, address: true, reason: "The model cannot be turned here:" };
mountOver(root, data.textContent, options).then((viewer) => (globalThis.viewer = viewer));
