// Show the data of this page, or else say why its picture stays.
addEventListener("hashchange", () => location.reload()); // another link was pasted
const root = document.getElementById("viewer");
const still = root.firstElementChild;
mount(root, document.getElementById("data").textContent, { link: location.hash, address: true }).then(
  (viewer) => (globalThis.viewer = viewer),
  (error) => {
    root.className = "";
    root.replaceChildren(still);
    still.lastElementChild.textContent = `The model cannot be turned here: ${error.message}.`;
  },
);
