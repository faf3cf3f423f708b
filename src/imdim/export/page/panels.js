// What stands around the view: figures at the head, what is selected, and sheets of tables below.

const WORDS = {
  volume_iou: "Volume IoU",
  volume_iou_missing: "No volume IoU",
  target_to_result: "target to result",
  result_to_target: "result to target",
};

const MOST_REGIONS = 12; // in the table of verdicts; report.json has more

const percent = (value, digits = 2) => `${(100 * value).toFixed(digits)} %`;

/** A share of the surface; what is not all is never told as 100 %, nor what is something as 0 %. */
const shareText = (share) =>
  share > 0 && share < 0.0005 ? "under 0.1 %" : share < 1 && share >= 0.9995 ? "over 99.9 %" : percent(share, 1);

/** A key of report.json as words. */
const words = (key) => WORDS[key] || key.replace(/_s$/, "").replace(/_/g, " ");

function table(rows, head) {
  const cells = (row, name) => row.map((cell) => element(name, typeof cell === "number" ? { class: "number" } : {}, contentOf(cell)));
  const out = element("table");
  if (head) out.append(element("thead", {}, element("tr", {}, ...cells(head, "th"))));
  out.append(element("tbody", {}, ...rows.map((row) => element("tr", {}, ...cells(row, "td")))));
  return element("div", { class: "scroll" }, out);
}

function contentOf(cell) {
  if (cell === null || cell === undefined || cell === "") return "-";
  return typeof cell === "number" ? shortNumber(cell) : cell;
}

function sheet(title, ...content) {
  return element("section", { class: "sheet" }, element("h2", {}, title), ...content);
}

/** What few look at: closed until its title is pressed. */
function folded(title, ...content) {
  return element("details", { class: "sheet" }, element("summary", {}, title), ...content);
}

function figures(list, data) {
  const { report } = data;
  const shown = [["Primitives", String(data.leaves.length)]];
  if (report) {
    const worst = report.scores.distance_relative_to_diagonal.target_to_result.max;
    if (report.scores.volume_iou !== null) shown.push(["Volume IoU", report.scores.volume_iou.toFixed(4)]);
    if (report.verdict) shown.push(["Exact", `${shareText(report.verdict.shares.exact)} of the surface`]);
    if (worst !== null) shown.push(["Furthest off", `${percent(worst, 3)} of the diagonal`]);
    shown.push(["Time", `${report.timing.total_s.toFixed(1)} s`]);
  }
  for (const [name, value] of shown) list.append(element("div", {}, element("dt", {}, name), element("dd", {}, value)));
}

/** One line on how the run ended. */
function summary({ report, target }) {
  if (!report) return target ? "A program beside its target." : "A program on its own.";
  const stops = {
    finished: "The search finished.",
    budget_spent: "The time budget ended the search.",
    exact: "Evolution ended with an exact program.",
    stagnation: "Evolution ended where nothing better came.",
  };
  const proof = report.proof ? ` ${report.proof[0].toUpperCase()}${report.proof.slice(1)}.` : "";
  const endings = {
    "left out": " This is not the part: most of its surface is left out.",
    "not explained": " This is not the part: the program does not explain what was measured.",
    partial: " This is the part at best in part: what was measured bears out no more.",
  };
  const lost = (report.verdict && endings[report.verdict.overall]) || "";
  return (stops[report.stop] || `Stopped: ${report.stop}.`) + proof + lost;
}

/** Names, numbers and constraints of the selected leaves. */
function showSelected(box, title, node, leaves, data) {
  box.replaceChildren();
  if (!leaves.length) {
    box.append(element("p", { class: "quiet" }, "Select a part of the program here, or click on the result."));
    return;
  }
  box.append(element("h3", {}, title));
  if (node && node.is === "primitive") box.append(...primitiveFacts(data.leaves[node.first], node));
  else box.append(element("p", {}, `${leaves.length} primitive${leaves.length > 1 ? "s" : ""}`));
  const binding = node && node.is === "primitive" ? data.constraints.filter((c) => c.leaves.includes(node.first)) : [];
  if (binding.length) box.append(element("h4", {}, "Bound by"), element("ul", {}, ...binding.map((c) => element("li", {}, constraintText(c)))));
}

function primitiveFacts(leaf, node) {
  const row = (number) => [number.name, number.value, number.says || ""];
  const turned = leaf.rotation.some((angle) => angle !== 0);
  const copies = node.all.length > 1 ? `, one of ${node.all.length} copies` : "";
  return [
    element("p", {}, `${leaf.kind}${drawnText(leaf)} #${node.first}, ${ROLE_WORDS[leaf.role]}${copies}`),
    leaf.outline ? outlineSketch(leaf.outline) : null,
    table([...leaf.sizes.map(row), ...leaf.center.map(row)], ["number", "value", "follows"]),
    turned ? element("p", {}, `turned by ${leaf.rotation.map(shortNumber).join(", ")} degrees about x, y, z`) : null,
  ].filter(Boolean);
}

const drawnText = (leaf) => (leaf.outline ? ` of ${leaf.outline.curves} curves` : "");

/** An outline with its length and height, and the radii of its arcs below. */
function outlineSketch({ low, high, radii, path }) {
  const [width, height] = [high[0] - low[0], high[1] - low[1]];
  const size = Math.max(width, height);
  const [room, unit] = [0.16 * size, size / 26];
  const box = [low[0] - room, -high[1] - room / 2, width + 1.5 * room, height + 1.5 * room];
  const text = (x, y, value, turn) =>
    svg("text", { x, y, "font-size": unit, "text-anchor": "middle", ...(turn ? { transform: `rotate(-90 ${x} ${y})` } : {}) }, shortNumber(value));
  const [right, below] = [(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2];
  const drawing = svg(
    "svg",
    { viewBox: box.join(" "), class: "outline", role: "img", "aria-label": `outline, ${shortNumber(width)} by ${shortNumber(height)}` },
    svg("path", { d: path, transform: "scale(1 -1)", "fill-rule": "evenodd", "stroke-width": size / 150 }),
    text(right, -low[1] + room / 2, width),
    text(low[0] - room / 2, below, height, true),
  );
  const shown = radii.slice(0, 8).map(shortNumber).join(", ") + (radii.length > 8 ? ` and ${radii.length - 8} more` : "");
  return element("figure", {}, drawing, radii.length ? element("figcaption", {}, `radii of arcs: ${shown}`) : null);
}

function constraintText(c) {
  const about = c.about ? ` about ${c.about}` : "";
  const value = c.value === null ? "" : `, ${shortNumber(c.value)}`;
  return `${c.kind}: ${c.of.join(", ")}${about}${value}`;
}

/** Rows as buttons that select leaves. */
function picks(entries, select) {
  return element(
    "ul",
    { class: "picks" },
    ...entries.map(({ name, says, leaves }) => {
      const button = element("button", { type: "button" }, element("b", {}, name), " ", element("span", {}, says));
      button.addEventListener("click", () => select(name, leaves));
      return element("li", {}, button);
    }),
  );
}

function sheets(data, select) {
  const { report, front } = data;
  const out = [];
  if (report && report.target.notes.length) {
    out.push(sheet("Notes on the target", element("ul", {}, ...report.target.notes.map((note) => element("li", {}, note)))));
  }
  if (report && report.verdict) out.push(verdictSheet(report.verdict));
  if (report && report.coverage) out.push(coverageSheet(report.coverage));
  if (front && front.choices.length) out.push(frontSheet(front));
  if (data.names.length) {
    const stated = (data.report && data.report.intervals) || {}; // of a noisy cloud: how well it knows each
    const names = data.names.map((n) => ({ ...n, says: n.name in stated ? stated[n.name].says : shortNumber(n.value) }));
    out.push(sheet("Names", element("p", { class: "quiet" }, "Change one and all that follows it moves: see program.scad."), picks(names, select)));
  }
  if (data.edges && data.edges.length) out.push(sheet("Edges", picks(data.edges.map((e) => ({ name: e.says, says: "", leaves: e.leaves })), select)));
  if (data.holes && data.holes.length) out.push(sheet("Holes", picks(data.holes.map((h) => ({ name: h.says, says: "", leaves: h.leaves })), select)));
  if (data.constraints.length) {
    out.push(sheet("Constraints", picks(data.constraints.map((c) => ({ ...c, name: c.name || c.kind, says: constraintText(c) })), select)));
  }
  return report ? [...leading(out, report), ...reportSheets(report)] : out;
}

/** What is made of the program comes first: its names and its files. */
function leading(out, report) {
  const names = out.filter((box) => box.querySelector("h2").textContent === "Names");
  return [...names, filesSheet(report.files), ...out.filter((box) => !names.includes(box))];
}

/** The files beside this page, as links where the page lies beside them: one that was sent alone has no others. */
function filesSheet(files) {
  const isBeside = location.pathname.endsWith("/report.html");
  const rows = Object.entries(files).map(([name, said]) => [
    isBeside && said === "written" && name !== "report.html" ? element("a", { href: encodeURIComponent(name) }, name) : name,
    said,
  ]);
  return sheet("Files", table(rows));
}

/** What became of the target's surface: shares, and the regions that are not exact. */
function verdictSheet({ says, regions }) {
  const row = (region) => [`${shareText(region.share)} ${region.verdict}`, `${region.what} ${region.where}`, region.furthest];
  const rows = regions.slice(0, MOST_REGIONS).map(row);
  const more = regions.length > rows.length ? ` The ${rows.length} largest regions of ${regions.length} are listed.` : "";
  const note = `The button Verdict under the view colours the target by this.${more}`;
  const list = rows.length ? table(rows, ["verdict", "what and where", "furthest off"]) : null;
  return sheet("Verdict", ...[element("p", {}, `${says}.`), element("p", { class: "quiet" }, note), list].filter(Boolean));
}

/** What a cloud shows of the result's surface: shares, and the regions that it does not show. */
function coverageSheet({ says, regions }) {
  const row = (region) => [`${shareText(region.share)} ${region.coverage}`, region.by || "", `${region.what} ${region.where}`];
  const rows = regions.slice(0, MOST_REGIONS).map(row);
  const note = "The button Seen under the view colours the result by this.";
  const list = rows.length ? table(rows, ["not seen", "inferred from", "what and where"]) : null;
  return sheet("Seen", ...[element("p", {}, `${says}.`), element("p", { class: "quiet" }, note), list].filter(Boolean));
}

function reportSheets(report) {
  const { scores, timing } = report;
  const far = Object.entries(scores.distance).flatMap(([way, both]) =>
    ["mean", "max"].map((what) => [`${what}, ${words(way)}`, both[what], scores.distance_relative_to_diagonal[way][what]]),
  );
  const { primitives, operations, curves, kinds, ops } = report.result;
  const size = curves ? [["features", primitives], ["curves in outlines", curves]] : [["primitives", primitives]];
  const counts = [...Object.entries(kinds), ...Object.entries(ops)];
  const target = Object.entries(report.target).filter(([key]) => key !== "notes");
  const listed = (values) => table(Object.entries(values).map(([key, value]) => [words(key), value === null ? null : value]));
  return [
    sheet(
      "Fit",
      table([["volume IoU", scores.volume_iou === null ? scores.volume_iou_missing : scores.volume_iou]]),
      table(far.map(([what, length, share]) => [what, length, share === null ? "-" : percent(share, 4)]), ["distance", "length", "of the diagonal"]),
    ),
    sheet("Target", table(target)),
    sheet("Program", table([...size, ["operations", operations], ...counts]), repeatList(report)),
    folded("Volumes", listed(report.volumes)),
    folded("Seconds", listed({ ...timing.stages_s, ...prefixed("delivery: ", timing.delivery_s), total: timing.total_s })),
    folded("Run", listed({ input: report.input, stop: report.stop, proof: report.proof, seed: report.seed, ...report.settings })),
    folded("Versions", table(Object.entries(report.versions))),
  ];
}

const prefixed = (text, values) => Object.fromEntries(Object.entries(values).map(([key, value]) => [text + key, value]));

function repeatList(report) {
  return report.repeats.length ? element("ul", {}, ...report.repeats.map((repeat) => element("li", {}, repeat.says))) : null;
}

/** "14 primitives", or "4 features, 45 curves in outlines". */
const sizeWords = (choice) =>
  choice.curves ? `${choice.features} features, ${choice.curves} curves in outlines` : `${choice.primitives} primitives`;

/** Error against size: a plot, whose points say how to take another program. */
function frontSheet(front) {
  const note = element("p", { class: "quiet", "aria-live": "polite" }, "Each point is a program in front.json. Select one to see how to take it.");
  const tell = (choice) => {
    const error = choice.error === null ? "error not measured" : `differs by ${percent(choice.error, 3)} of the volume`;
    const taken = choice.pick === front.picked ? " This is the program of this page." : "";
    const command = element("code", {}, `imdim export front.json --pick ${choice.pick} -o out/pick${choice.pick}`);
    note.replaceChildren(`Number ${choice.pick}: ${sizeWords(choice)}, ${error}.${taken} `, command);
  };
  return sheet("From crude to exact", plot(front, tell), note);
}

function svg(name, attributes, ...children) {
  const out = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) out.setAttribute(key, value);
  out.append(...children);
  return out;
}

function plot(front, tell) {
  const [width, height, left, bottom] = [420, 230, 62, 40];
  const known = front.choices.filter((choice) => choice.error !== null);
  const errors = known.map((choice) => Math.max(choice.error, 1e-6));
  const decades = [Math.floor(Math.log10(Math.min(...errors, 0.1))), Math.ceil(Math.log10(Math.max(...errors, 0.01)))];
  const most = Math.max(...front.choices.map((choice) => choice.primitives), 2);
  const x = (primitives) => left + 12 + ((width - left - 30) * primitives) / most;
  const y = (error) => 12 + ((height - bottom - 18) * (decades[1] - Math.log10(Math.max(error, 1e-6)))) / (decades[1] - decades[0]);
  const out = svg("svg", { viewBox: `0 0 ${width} ${height}`, class: "plot", role: "group", "aria-label": "error against primitives" });
  for (let d = decades[0]; d <= decades[1]; d++) {
    const at = y(10 ** d);
    out.append(svg("line", { x1: left, x2: width - 8, y1: at, y2: at, class: "grid" }));
    out.append(svg("text", { x: left - 8, y: at + 4, "text-anchor": "end" }, `${Number((100 * 10 ** d).toPrecision(1))} %`));
  }
  const every = Math.max(1, Math.ceil(most / 8));
  for (let n = 0; n <= most; n += every) {
    out.append(svg("text", { x: x(n), y: height - bottom + 14, "text-anchor": "middle" }, String(n)));
  }
  out.append(svg("text", { x: (left + width) / 2, y: height - 8, "text-anchor": "middle", class: "axis" }, "primitives"));
  const middle = (height - bottom) / 2;
  out.append(svg("text", { x: 12, y: middle, "text-anchor": "middle", class: "axis", transform: `rotate(-90 12 ${middle})` }, "error"));
  out.append(svg("polyline", { points: known.map((c) => `${x(c.primitives)},${y(c.error)}`).join(" "), class: "front" }));
  for (const choice of known) {
    const own = choice.pick === front.picked;
    const label = `number ${choice.pick}, ${sizeWords(choice)}, error ${percent(choice.error, 3)}`;
    const at = { cx: x(choice.primitives), cy: y(choice.error), r: own ? 8 : 6, class: own ? "own" : "other" };
    const dot = svg("circle", { ...at, tabindex: 0, role: "button", "aria-label": label }, svg("title", {}, label));
    dot.addEventListener("click", () => tell(choice));
    dot.addEventListener("focus", () => tell(choice));
    out.append(dot);
  }
  return out;
}
