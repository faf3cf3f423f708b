"""The parameter table as HTML: one row for each named number, with its unit, its lock, and what it drives.

What happens in it goes through inputs that nobody sees (`renderers`): a value that is set as text, the row that the pointer is on as its
number, a lock and a tie as clicks. The table is drawn anew where a value changes, so the script of the page puts the focus back, and what
was typed: at once, or a key that is pressed meanwhile would go nowhere. Browsers tell a change of an input that is taken away, which nobody
has ended typing in, and none of what a script has put back: what is set is what was typed last, by Enter or by leaving an input that is
there.
"""

from __future__ import annotations

import html
from collections.abc import Sequence

from imdim.app.lab.parameters import ParameterRow
from imdim.app.lab.renderers import clickable

ACTIONS = 2  # that a row has buttons for: to hold and to untie
DIGITS = 9  # that texts keep
# drawn, since not every machine has a font with locks
_BODY = '<rect x="3" y="7" width="10" height="7" rx="1" fill="currentColor"/>'
_ICON = '<svg width="14" height="14" viewBox="0 0 16 16" aria-hidden="true" style="display:block">{}{}</svg>'
_OPEN, _CLOSED = (
    _ICON.format(_BODY, f'<path d="{shackle}" fill="none" stroke="currentColor" stroke-width="1.6"/>')
    for shackle in ("M5.5 7V3.5a2.5 2.5 0 0 1 5 0V4.5", "M5.5 7V4.5a2.5 2.5 0 0 1 5 0V7")
)

# installed once; inputs of the table are told apart by what they are called
SCRIPT = """
if (!window.labTable) {
  const T = window.labTable = { count: 0, row: -1, pinned: -1, focus: null, typed: null };
  const rowOf = (e) => { const r = e.target.closest?.('.lab-parameter [data-row]'); return r ? Number(r.dataset.row) : -1; };
  const nameOf = (e) => e.target.matches?.('.lab-parameter input[data-name]') ? e.target.dataset.name : null;
  const send = (to, text) => {
    const input = document.querySelector(`.lab-unseen[data-to='${to}']`)?.parentElement.nextElementSibling?.querySelector('input');
    if (!input) return;
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(input, `${++T.count} ${text}`);
    input.dispatchEvent(new Event('input', { bubbles: true }));
  };
  const show = (row) => {
    if (row === T.row) return;
    T.row = row;
    clearTimeout(T.later);
    T.later = setTimeout(() => send('ParameterRow', row), 80);
  };
  const pin = (row) => { T.pinned = row; show(row); };
  document.addEventListener('pointerover', (e) => { const row = rowOf(e); show(row < 0 ? T.pinned : row); });
  document.addEventListener('click', (e) => { const row = rowOf(e); if (row >= 0) pin(row); });
  document.addEventListener('pointerdown', (e) => { if (rowOf(e) < 0) { T.focus = null; pin(-1); } });
  document.addEventListener('focusin', (e) => { T.focus = nameOf(e); if (T.focus) pin(rowOf(e)); });
  document.addEventListener('input', (e) => { const name = nameOf(e); if (name) T.typed = [name, e.target.value]; });
  const set = (e) => {
    const name = nameOf(e);
    if (!name || T.typed?.[0] !== name) return;
    const value = T.typed[1];
    T.typed = null;
    if (value !== e.target.defaultValue) send('ParameterValue', `${name}=${value}`);
  };
  const leave = (e) => queueMicrotask(() => {
    if (!e.target.isConnected) return;
    set(e);
    if (e.type === 'focusout' && nameOf(e) === T.focus) T.focus = null;
  });
  document.addEventListener('change', leave);
  document.addEventListener('focusout', leave);
  document.addEventListener('keydown', (e) => {
    if (e.key === 'Enter') set(e);
    if (!nameOf(e) || e.key !== 'Escape') return;
    e.target.value = e.target.defaultValue;
    T.typed = T.focus = null;
    e.target.blur();
    pin(-1);
  });
  const drawn = () => {
    if (!T.focus || document.activeElement !== document.body) return;
    const input = document.querySelector(`.lab-parameter input[data-name='${T.focus}']`);
    if (!input) return;
    input.focus({ preventScroll: true });
    if (T.typed?.[0] === T.focus) input.value = T.typed[1]; else input.select();
  };
  new MutationObserver(drawn).observe(document.body, { childList: true, subtree: true });
}"""


def parameter_table(rows: Sequence[ParameterRow], unit: str, selected: int | None, refused: int) -> str:
    """The table; rows of what is selected are marked. `refused` makes it another one, in which what was typed in vain is gone."""
    body = "".join(_row(i, row, unit, selected is not None and selected in row.shown) for i, row in enumerate(rows))
    return clickable("Parameter", f'<div data-refused="{refused}">{body}</div>')


def _row(number: int, row: ParameterRow, unit: str, marked: bool) -> str:
    name, drives = html.escape(row.name), html.escape(row.drives)
    sign = {"length": unit, "degrees": "°", "count": "×"}[row.unit]
    value = f"{row.value:.{DIGITS}g}"
    return (
        f'<div class="lab-row" data-row="{number}"{" data-marked" if marked else ""}>'
        f'<label class="lab-name" title="{name}">{name}</label>'
        f'<input data-name="{name}" aria-label="{name}" value="{value}" inputmode="decimal" autocomplete="off" spellcheck="false">'
        f'<span class="lab-unit">{sign}</span>{_lock(number, row)}'
        f'<span class="lab-drives" title="{drives}">{drives}</span>{_untie(number, row)}</div>'
    )


def _lock(number: int, row: ParameterRow) -> str:
    if not row.locks:
        return '<span title="The solver never changes this number"></span>'
    says = f"Let the solver change {row.name}" if row.locked else f"Keep {row.name} fixed for the solver"
    return _button(ACTIONS * number, says, _CLOSED if row.locked else _OPEN, row.locked)


def _untie(number: int, row: ParameterRow) -> str:
    if not row.tied:
        return ""
    return _button(ACTIONS * number + 1, f"Untie {row.name}: each feature gets a number of its own", "untie", None)


def _button(number: int, says: str, text: str, pressed: bool | None) -> str:
    state = "" if pressed is None else f' aria-pressed="{str(pressed).lower()}"'
    label = html.escape(says)
    return f'<button type="button" data-n="{number}" title="{label}" aria-label="{label}"{state}>{text}</button>'
