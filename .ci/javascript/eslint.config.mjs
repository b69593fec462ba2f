// What eslint finds in the project's JavaScript, scripts in HTML among it: run by .ci/check_javascript.py.
import js from "@eslint/js";
import html from "eslint-plugin-html";
import globals from "globals";

export default [
  js.configs.recommended,
  {
    rules: {
      "consistent-return": "off",
      eqeqeq: "error",
      "no-shadow": ["error", { builtinGlobals: false }],
      "no-var": "error",
      "object-shorthand": "error",
      "prefer-const": "error",
      "prefer-template": "error",
    },
    linterOptions: { reportUnusedDisableDirectives: "error" },
  },
  { files: ["**/*.html"], plugins: { html } },
  { files: ["**/*.mjs", "**/*.js", "**/*.html"], languageOptions: { globals: globals.browser } },
  { files: ["**/*.js"], languageOptions: { sourceType: "script" } },
  { files: ["decals/pages/viewer/start.js"], languageOptions: { globals: { mountOver: "readonly" } } },
  { files: ["tests/**/*.js"], languageOptions: { sourceType: "commonjs", globals: globals.node } },
];
