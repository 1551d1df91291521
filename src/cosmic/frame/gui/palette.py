"""The colours of the two themes, as plain text, and how well they can be read."""

from dataclasses import dataclass
from typing import Final, Literal

ThemeName = Literal["dark", "light"]

OKABE_ITO: Final = {
    "orange": "#E69F00",
    "sky blue": "#56B4E9",
    "bluish green": "#009E73",
    "yellow": "#F0E442",
    "blue": "#0072B2",
    "vermillion": "#D55E00",
    "reddish purple": "#CC79A7",
}
"""Colours that people with any colour vision tell apart; for states and curves."""

INK: Final = "#101214"
"""Text on a field filled with one of the Okabe-Ito colours."""

ON_IMAGE: Final = {
    "ink": "#FFFFFF",
    "found": "#35D0A0",
    "rim": "#96000000",
    "faint rim": "#50000000",
    "label": "#A5000000",
    "text": "#B9000000",
    "notice": "#F2101214",
}
"""What is drawn over images, bright or dark, in every theme, some as "#AARRGGBB".

"found" is Okabe-Ito's bluish green, lighter: the original is lost on a grey image.
"""


@dataclass(frozen=True, slots=True)
class Palette:
    """The colours of one theme as "#RRGGBB"; widgets name their role, never a colour."""

    name: ThemeName
    window: str
    panel: str
    raised: str
    hover: str
    field: str
    border: str
    border_strong: str
    text: str
    dim: str
    disabled: str
    accent: str
    on_accent: str
    stop: str
    stop_hover: str
    latched: str
    on_stop: str
    refused: str
    warning: str


DARK: Final = Palette(
    name="dark",
    window="#17191C",
    panel="#1F2226",
    raised="#2C3036",
    hover="#383D44",
    field="#121417",
    border="#363B42",
    border_strong="#59616B",
    text="#E9ECEF",
    dim="#A4ACB5",
    disabled="#6C747D",
    accent="#6CA8FF",
    on_accent="#0D1116",
    stop="#D0142C",
    stop_hover="#B00D27",
    latched="#8A0F20",
    on_stop="#FFFFFF",
    refused="#FF8A4C",
    warning="#F0E442",
)

LIGHT: Final = Palette(
    name="light",
    window="#E9ECEF",
    panel="#F8F9FA",
    raised="#FFFFFF",
    hover="#E3E8ED",
    field="#FFFFFF",
    border="#C7CDD4",
    border_strong="#8B949E",
    text="#16191C",
    dim="#535C66",
    disabled="#949CA5",
    accent="#0A5CC2",
    on_accent="#FFFFFF",
    stop="#D0142C",
    stop_hover="#B00D27",
    latched="#8A0F20",
    on_stop="#FFFFFF",
    refused="#B34700",
    warning="#E69F00",
)


def blend(colour: str, ground: str, share: float) -> str:
    """Return `colour` laid over `ground` with the opacity `share`."""
    mixed = (
        round(share * over + (1.0 - share) * under)
        for over, under in zip(_rgb(colour), _rgb(ground), strict=True)
    )
    return "#{:02X}{:02X}{:02X}".format(*mixed)


def contrast_ratio(first: str, second: str) -> float:
    """Return the contrast of two colours, 1 to 21, as WCAG 2 defines it."""
    high, low = sorted((_luminance(first), _luminance(second)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def _luminance(colour: str) -> float:
    parts = [part / 255.0 for part in _rgb(colour)]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def _rgb(colour: str) -> tuple[int, int, int]:
    digits = colour.removeprefix("#")
    return int(digits[0:2], 16), int(digits[2:4], 16), int(digits[4:6], 16)
