// Print the reports of Khronos' validator on glTF files as JSON: node validate_gltf.js FILE...
const { readFileSync } = require("fs");
const { validateBytes } = require("gltf-validator");

Promise.all(
  process.argv.slice(2).map((path) => validateBytes(new Uint8Array(readFileSync(path)), { uri: path })),
).then((reports) => console.log(JSON.stringify(reports.map((report) => report.issues))));
