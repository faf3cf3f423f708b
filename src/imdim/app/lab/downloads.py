"""The files of a program, made once, and those who wait for them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from imdim.app.lab.protocol import Message

Files = Mapping[str, bytes]
Wanted = Callable[[Files], None]


class Downloads:
    """See the module. A revision of the history stands for its program; `making` is the one whose files are asked for."""

    def __init__(self) -> None:
        self.making = -1
        self._made: tuple[int, Files] | None = None
        self._wishes: list[Wanted] = []

    def of(self, revision: int) -> Files | None:
        """The files of that revision, None where they are still to be made."""
        return self._made[1] if self._made and self._made[0] == revision else None

    def wish(self, wanted: Wanted) -> None:
        """Call `wanted` when the files are there."""
        self._wishes.append(wanted)

    def keep_files(self, message: Message) -> None:
        """The files of a "files" message are those of the revision that was asked for; a program may have been edited since."""
        self._made = self.making, {name: data.tobytes() for name, data in message.arrays.items()}

    def send(self) -> None:
        """To all who wait."""
        wishes, self._wishes = self._wishes, []
        if self._made is None:
            return
        for wanted in wishes:
            wanted(self._made[1])

    def forget_wishes(self) -> None:
        """Nothing could be made."""
        self._wishes = []
