// Reads the data, builds the page, and ties selection together.

const TARGET_TITLE = "Target, coloured by its distance to the result";

function start() {
  const data = JSON.parse(document.getElementById("data").textContent);
  const at = (id) => document.getElementById(id);
  figures(at("figures"), data);
  at("summary").textContent = summary(data);
  const view = startView(at, data);
  const tree = new Tree(at("tree"), data.tree, data.leaves, (node) => chooseNode(node));
  let chosen = null;

  function choose(title, node, leaves) {
    chosen = node;
    tree.mark(node);
    view?.pick(leaves);
    showSelected(at("selected"), title, node, leaves, data);
  }
  function chooseNode(node) {
    if (node === null || node === chosen) choose("", null, []);
    else choose(titleOf(node, data.leaves), node, node.all);
  }
  showSelected(at("selected"), "", null, [], data);
  at("sheets").append(...sheets(data, (title, leaves) => choose(title, null, leaves)));
  if (!view) return;
  view.onPick = (leaf) => chooseNode(leaf === null ? null : tree.nodeOf(leaf));
}

/** The view with its panes and buttons, or a message where there is no WebGL. */
function startView(at, data) {
  const names = data.target ? ["target", "result"] : ["result"];
  const panes = Object.fromEntries(names.map((name) => [name, element("div", { class: "pane" }, paneTitle(name, data))]));
  at("panes").append(...Object.values(panes));
  let view;
  try {
    view = new View(at("canvas"), data, panes);
  } catch (error) {
    at("hint").textContent = `This browser draws no 3D (${error.message}). preview.png, beside this page, is a picture of the part.`;
    at("hint").hidden = false;
    return null;
  }
  if (data.target) panes.target.append(legend(view.top));
  if (view.verdicts && data.report) panes.target.append(shareLegend("verdicts", VERDICTS, data.report.verdict.shares));
  if (view.coverage && data.report) panes.result.append(shareLegend("coverage", COVERAGES, data.report.coverage.shares));
  view.onPoint = (distance) => {
    const text = distance === null ? "" : `distance here: about ${shortNumber(Number(distance.toPrecision(3)))}`;
    panes.target.querySelector(".readout").textContent = text;
  };
  steer(view);
  steerByKeys(view, tools(at("tools"), view, Boolean(data.target)));
  return view;
}

/** The legend that belongs to the colours of the target. */
function showVerdicts(on) {
  document.querySelector(".legend").hidden = on;
  const list = document.querySelector(".verdicts");
  if (list) list.hidden = !on;
  document.querySelector(".pane-title").textContent = on ? "Target, coloured by what became of it" : TARGET_TITLE;
}

function paneTitle(name, data) {
  const count = `${data.leaves.length} primitive${data.leaves.length === 1 ? "" : "s"}`;
  const text = name === "target" ? TARGET_TITLE : `Result, ${count}`;
  return element("p", { class: "pane-title" }, text);
}

function legend(top) {
  const bar = element("div", { class: "bar", role: "img", "aria-label": `colours from 0 to ${shortNumber(top)}` });
  const marks = [0, 0.5, 1].map((share) => element("span", {}, shortNumber(Number((share * top).toPrecision(3)))));
  return element("div", { class: "legend" }, element("p", { class: "readout", "aria-live": "polite" }), bar, element("div", { class: "marks" }, ...marks));
}

/** The legend that belongs to the colours of the result. */
function showCoverage(on) {
  const list = document.querySelector(".coverage");
  if (list) list.hidden = !on;
}

/** What colours mean, with their shares of the surface; hidden until they are drawn. */
function shareLegend(name, colors, shares) {
  const entry = ([word]) => {
    const swatch = element("span", { class: `swatch ${word.replace(" ", "-")}` });
    return element("li", {}, swatch, ` ${word} ${shareText(shares[word])}`);
  };
  return element("ul", { class: `shares ${name}`, hidden: "" }, ...Object.entries(colors).map(entry));
}

/** The buttons under the view; returns what keys do, by letter. */
function tools(bar, view, hasTarget) {
  const commands = {};
  const button = (text, key, act, pressed) => {
    const out = element("button", { type: "button", "aria-pressed": pressed, title: `key ${key}` }, text);
    out.addEventListener("click", act);
    bar.append(out);
    commands[key] = act;
    return out;
  };
  const toggle = (text, key, what, then = () => {}) => {
    const out = button(text, key, () => {
      view.set(what, !view.show[what]);
      out.setAttribute("aria-pressed", String(view.show[what]));
      then(view.show[what]);
    }, String(view.show[what]));
  };
  if (hasTarget) toggle("Distances", "d", "distances");
  if (view.verdicts) toggle("Verdict", "v", "verdicts", showVerdicts);
  if (view.coverage) toggle("Seen", "n", "coverage", showCoverage);
  toggle("Operations", "o", "operations");
  toggle("Cutters", "c", "cutters");
  toggle("Edges", "e", "edges");
  const looks = { Front: ["f", 0, 0], Side: ["s", Math.PI / 2, 0], Top: ["t", 0, Math.PI / 2] };
  for (const [name, [key, yaw, pitch]] of Object.entries(looks)) {
    button(name, key, () => {
      view.camera.look(yaw, pitch);
      view.redraw();
    });
  }
  button("Reset", "0", () => {
    view.camera.reset();
    view.redraw();
  });
  return commands;
}

start();
