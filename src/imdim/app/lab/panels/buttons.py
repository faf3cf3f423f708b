"""Buttons that can be pressed only where they do something."""

from __future__ import annotations

from collections.abc import Sequence

import viser


def enable(handle: viser.GuiButtonHandle, on: bool) -> None:
    """Let it be pressed or not; the page is told where that changes."""
    if handle.disabled == on:
        handle.disabled = not on


def offer(group: viser.GuiButtonGroupHandle, options: Sequence[str]) -> None:
    """Show those buttons of a group that do something."""
    if tuple(group.options) != tuple(options):
        group.options = tuple(options)
