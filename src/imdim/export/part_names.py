"""What exported files call a part and its features, and the colours of these."""

from __future__ import annotations

import unicodedata
from typing import NamedTuple

from imdim.program.roles import signs
from imdim.program.tree import Program

NAMELESS = "part"  # what a part without a name is called
BLEND = "blend"  # what fillets and chamfers are called
Colour = tuple[float, float, float]  # red, green, blue of sRGB, 0 to 1
ADDED: Colour = (0.53, 0.63, 0.75)
CUT: Colour = (0.80, 0.36, 0.30)
BLENDED: Colour = (0.68, 0.73, 0.60)


class PartNames(NamedTuple):
    """The name of a part, that of each leaf's feature, and whether that cuts."""

    part: str
    features: tuple[str, ...]
    cuts: tuple[bool, ...]

    @staticmethod
    def of(program: Program, part: str = NAMELESS, features: tuple[str, ...] | None = None) -> PartNames:
        """`features` are by default named by their roles."""
        return PartNames(spell(part) or NAMELESS, features or _label(program), tuple(sign < 0 for sign in signs(program)))

    def feature(self, leaf: int) -> tuple[str, Colour]:
        """The name and the colour of what a leaf made; numbers beyond the leaves are blends."""
        if leaf >= len(self.features):
            return BLEND, BLENDED
        return self.features[leaf], CUT if self.cuts[leaf] else ADDED


def _label(program: Program) -> tuple[str, ...]:
    from imdim.export.feature_names import label_features  # with it come compiled kernels, which who hands names over does without

    return label_features(program)


def spell(name: str) -> str:
    """A name in the letters that every reader knows, the printable ones of ASCII."""
    plain = unicodedata.normalize("NFKD", name)
    return "".join(c if " " <= c <= "~" else "_" for c in plain if not unicodedata.combining(c)).strip()
