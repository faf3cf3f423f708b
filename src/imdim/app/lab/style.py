"""What the page needs beside the toolkit's own widgets: a narrow window, contrast, and files that are dropped anywhere on it."""

from __future__ import annotations

import html

BLUE, GREY, RED = (24, 100, 171), (73, 80, 87), (201, 42, 42)  # buttons; white on them has a contrast of 5.5 and more
BRAND = (13, 54, 93)  # the toolkit draws text in a lighter shade of it, near BLUE
LINK = "#1864ab"
MUTED = "#495057"  # labels, 8.2 on white
SHEET = 55  # per cent of a narrow window's height that the controls take at most

# the toolkit's message on a file says "uploaded successfully" before anybody has read it: the status tells of files
_UPLOAD = '[id^="upload-"].mantine-Notification-root'
# the toolkit's sheet for narrow windows lies over the picture; here it stands below it, and the picture takes what is left
_SHEET = '.mantine-Paper-root[style*="fixed"]'
_CSS = f"""
:root, :root[data-mantine-color-scheme] {{ --mantine-color-dimmed: {MUTED} !important }}
.mantine-Notification-description {{ color: {MUTED} !important }}
{_UPLOAD}, div:has(> .lab-unseen) + div {{ display: none }}
.mantine-Slider-markLabel {{ color: {MUTED} !important }}
.mantine-Button-root:disabled {{ color: {MUTED} !important }}
.lab-status tbody {{ display: grid; grid-template-columns: 1fr 1fr; gap: 1px 12px }}
.lab-status tr {{ display: flex; gap: 6px }}
.lab-status tr.wide {{ grid-column: 1 / -1 }}
.lab-status td {{ padding: 0 }}
.lab-row {{ display: grid; grid-template-columns: minmax(0, 1fr) 64px 20px 22px; gap: 0 4px; align-items: center; padding: 1px 4px;
  margin: 0; border-radius: 4px; font-size: 12px; color: #212529; cursor: default }}
.lab-row:hover, .lab-row:focus-within, .lab-row[data-marked] {{ background: #fff3bf }}
.lab-name {{ font-weight: 600; overflow: hidden; text-overflow: ellipsis; white-space: nowrap }}
.lab-row input {{ width: 100%; border: 1px solid #ced4da; border-radius: 4px; padding: 0 4px; height: 19px; font: inherit;
  text-align: right; color: #212529; background: #fff }}
.lab-row button {{ border: 0; background: none; font: inherit; color: {LINK}; cursor: pointer; padding: 1px 2px; border-radius: 4px }}
.lab-row button:hover, .lab-row button[aria-pressed=true] {{ background: #ffe066 }}
.lab-drives {{ grid-column: 1 / 3; color: {MUTED}; font-size: 11px; line-height: 1.25; overflow: hidden; text-overflow: ellipsis;
  white-space: nowrap }}
.lab-drives + button {{ grid-column: 3 / -1; text-align: right }}
.lab-drives:last-child {{ grid-column: 1 / -1 }}
.lab-status .wide td + td {{ min-width: 0; overflow: hidden; text-overflow: ellipsis; white-space: nowrap }}
@media (max-width: 36em) {{
  #root div:has(> {_SHEET}) {{ flex-direction: column }}
  #root div:has(> {_SHEET}) > div:not([class]) {{ height: auto !important; min-height: 0 }}
  #root {_SHEET} {{ position: static !important; flex: none; width: 100% !important; max-height: {SHEET}% !important }}
  #root {_SHEET} div[style*="20em"] {{ width: 100% !important }}
}}
"""
# a dropped file goes the way of one that was chosen
_DROP = """
if (!window.labDrops) {
  window.labDrops = true;
  window.addEventListener('dragover', (e) => { if (e.dataTransfer.types.includes('Files')) e.preventDefault(); });
  window.addEventListener('drop', (e) => {
    const input = document.querySelector('input[type=file]');
    if (!e.dataTransfer.files.length || !input) return;
    e.preventDefault();
    input.files = e.dataTransfer.files;
    input.dispatchEvent(new Event('change', { bubbles: true }));
  });
}"""
NOTHING = "data:image/gif;base64,R0lGODlhAQABAAAAACH5BAEKAAEALAAAAAABAAEAAAICTAEAOw=="


def style(*scripts: str) -> str:
    """HTML to put on the page once, with `scripts`, which run only as handlers, so that an empty picture carries them."""
    run = html.escape("\n".join((_DROP, *scripts)), quote=True)
    return f'<style>{_CSS}</style><img alt="" src="{NOTHING}" style="display:none" onload="{run}">'
