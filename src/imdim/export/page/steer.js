// The view under mouse, touch and keys.

/** Mouse, pen, touch and wheel: drag turns, shift or the right button or two fingers move, wheel or pinch zooms. */
function steer(view) {
  const { canvas, camera } = view;
  const down = new Map();
  let travelled = 0;
  const spread = () => {
    const [a, b] = [...down.values()];
    return b ? { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, apart: Math.hypot(a.x - b.x, a.y - b.y) } : { ...a, apart: 0 };
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    if (!down.size) travelled = 0;
    down.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!down.has(event.pointerId)) return;
    const before = spread();
    down.set(event.pointerId, { x: event.clientX, y: event.clientY });
    const after = spread();
    const side = Math.min(canvas.clientWidth, canvas.clientHeight);
    const [dx, dy] = [(after.x - before.x) / side, (after.y - before.y) / side];
    travelled += Math.hypot(after.x - before.x, after.y - before.y) + (down.size > 1 ? 10 : 0);
    if (down.size > 1 || event.shiftKey || event.buttons & 2) camera.pan(dx, -dy);
    else camera.turn(3.6 * dx, 3.6 * dy);
    if (before.apart && after.apart) camera.zoom(before.apart / after.apart);
    view.redraw();
  });
  const up = (event) => {
    if (!down.delete(event.pointerId) || down.size) return;
    if (event.type === "pointerup" && travelled < 5 && event.button === 0) view.click(event.clientX, event.clientY);
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    camera.zoom(Math.exp(Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY), 120) * 0.0012));
    view.redraw();
  }, { passive: false });
}

/** Keys on the focused view; `commands` are those of the buttons, by their letter. */
function steerByKeys(view, commands) {
  const { canvas, camera } = view;
  const turn = Math.PI / 24;
  const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrow = arrows[event.key];
    if (arrow && event.shiftKey) camera.pan(0.06 * arrow[0], -0.06 * arrow[1]);
    else if (arrow) camera.turn(turn * arrow[0], turn * arrow[1]);
    else if ("+=".includes(event.key)) camera.zoom(0.88);
    else if ("-_".includes(event.key)) camera.zoom(1 / 0.88);
    else if (event.key === "Escape") view.onPick(null);
    else if (commands[event.key.toLowerCase()]) commands[event.key.toLowerCase()]();
    else return;
    event.preventDefault();
    view.redraw();
  });
}
