// The program as a tree. One node or one set of leaves is selected at a time; whoever selects, tree, view and tables follow.

const SIGNS = { union: "∪", difference: "−", intersection: "∩", linear: "⋯", grid: "⊞", circular: "↻", mirror: "⇋" };
const ROLE_WORDS = { adds: "adds material", cuts: "cuts material away", bounds: "bounds what is kept" };

/** An element with attributes, and children that are elements or text; text is never read as markup. */
function element(name, attributes = {}, ...children) {
  const out = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value !== null && value !== undefined) out.setAttribute(key, value);
  }
  out.append(...children.filter((child) => child !== null && child !== undefined));
  return out;
}

const range = (count) => Array.from({ length: count }, (_, i) => i);

/** Six digits, no more zeros than needed; three for what is tiny. */
function shortNumber(value) {
  if (typeof value !== "number") return String(value);
  return String(Number(value.toPrecision(Math.abs(value) < 1e-3 ? 3 : 6)));
}

function titleOf(node, leaves) {
  const counts = (node.counts || []).map(String).join(" × ");
  const titles = {
    primitive: () => `${leaves[node.first].label}`,
    union: () => `union of ${node.parts.length}`,
    difference: () => `difference: first part minus ${node.parts.length - 1}`,
    intersection: () => `intersection of ${node.parts.length}`,
    linear: () => `row of ${counts}`,
    grid: () => `grid of ${counts}`,
    circular: () => `circle of ${counts}`,
    mirror: () => "mirrored pair",
  };
  return titles[node.is]() + (node.join === "intersection" ? ", intersected" : "");
}

/** A primitive in one line: its kind, and its sizes with their names. */
function sizesOf(leaf) {
  return leaf.sizes.map((size) => `${size.name} ${shortNumber(size.value)}`).join(", ");
}

class Tree {
  /** `onSelect(node)` is called with the node that a person selects. */
  constructor(list, root, leaves, onSelect) {
    this.leaves = leaves;
    this.onSelect = onSelect;
    this.rows = [];
    list.append(this.#item(root, 1, false, [0]));
    this.rows[0].item.tabIndex = 0;
    list.addEventListener("keydown", (event) => this.#key(event));
  }

  /** `copies` are how much later than the first each copy of the node begins, where repeats are around it. */
  #item(node, level, cut, copies) {
    const primitive = node.is === "primitive";
    const leaf = this.leaves[node.first];
    const role = primitive ? leaf.role : "";
    const sign = primitive ? "" : SIGNS[node.is];
    const open = node.parts.length ? "true" : null;
    const item = element("li", { role: "treeitem", "aria-level": level, "aria-expanded": open, "aria-selected": "false", tabindex: -1 });
    const row = element(
      "div",
      { class: "row" },
      element("span", { class: "twist", "aria-hidden": "true" }, node.parts.length ? "▾" : ""),
      element("span", { class: `mark ${role}`, "aria-hidden": "true" }, sign),
      element("span", { class: "name" }, titleOf(node, this.leaves)),
      cut ? element("span", { class: "cut" }, "cut") : null,
      primitive ? element("span", { class: "sizes" }, `${leaf.kind} ${sizesOf(leaf)}`) : null,
    );
    item.append(row);
    node.all = copies.flatMap((later) => range(node.leaves).map((i) => node.first + later + i));
    this.rows.push({ node, item });
    if (node.parts.length) {
      const group = element("ul", { role: "group" });
      const size = node.parts[0].leaves;
      const inner = node.counts ? copies.flatMap((later) => range(node.leaves / size).map((i) => later + i * size)) : copies;
      node.parts.forEach((part, i) => group.append(this.#item(part, level + 1, node.is === "difference" && i > 0, inner)));
      item.append(group);
    }
    row.addEventListener("click", (event) => {
      if (event.target.className === "twist" && node.parts.length) this.#expand(item, item.getAttribute("aria-expanded") !== "true");
      else this.onSelect(node);
    });
    return item;
  }

  #expand(item, open) {
    item.setAttribute("aria-expanded", String(open));
    item.querySelector(".twist").textContent = open ? "▾" : "▸";
  }

  /** Mark a node, or none, and bring it into sight inside the tree. */
  mark(node) {
    for (const { node: other, item } of this.rows) {
      const own = other === node;
      item.setAttribute("aria-selected", String(own));
      item.tabIndex = own ? 0 : -1;
      if (own) this.#reveal(item);
    }
    if (!node) this.rows[0].item.tabIndex = 0;
  }

  #reveal(item) {
    for (let at = item.parentElement.closest("li"); at; at = at.parentElement.closest("li")) this.#expand(at, true);
    const [own, box] = [item.firstChild.getBoundingClientRect(), item.closest("#tree").getBoundingClientRect()];
    const list = item.closest("#tree");
    if (own.top < box.top || own.bottom > box.bottom) list.scrollTop += own.top - box.top - box.height / 2;
  }

  /** The primitive that a leaf is, or is a copy of: the deepest node that has it comes last. */
  nodeOf(leaf) {
    return this.rows.filter(({ node }) => node.all.includes(leaf)).pop().node;
  }

  #key(event) {
    const shown = this.rows.filter(({ item }) => !item.parentElement.closest('li[aria-expanded="false"]'));
    const at = shown.findIndex(({ item }) => item === document.activeElement);
    if (at < 0) return;
    const { item, node } = shown[at];
    const open = item.getAttribute("aria-expanded");
    const moves = {
      ArrowDown: () => shown[at + 1]?.item.focus(),
      ArrowUp: () => shown[at - 1]?.item.focus(),
      Home: () => shown[0].item.focus(),
      End: () => shown[shown.length - 1].item.focus(),
      ArrowRight: () => (open === "false" ? this.#expand(item, true) : open && shown[at + 1]?.item.focus()),
      ArrowLeft: () => (open === "true" ? this.#expand(item, false) : item.parentElement.closest("li")?.focus()),
      Enter: () => this.onSelect(node),
      " ": () => this.onSelect(node),
    };
    if (!moves[event.key]) return;
    event.preventDefault();
    moves[event.key]();
  }
}
