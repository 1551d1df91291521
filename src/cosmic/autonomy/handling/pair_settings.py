"""Settings of two hands that work side by side."""

from pydantic import Field

from cosmic.frame.config import StrictModel


class PairSettings(StrictModel):
    """How two hands keep out of each other's way, each on its own side of the middle.

    Attributes
    ----------
    apart_um : float
        How far from the middle the tips of a hand stay at the plate and before the probe.
    behind_um : float
        How far behind that a hand waits with its fibre, and draws back to from the probe.
    beside_um : float
        How far beside the place before the probe it waits, towards the operator.
    hidden_um : float
        How far from that place, towards the operator, fibres must lie to be taken while the other
        hand is there: nearer they may be hidden.
    probe_back_um : float
        How far the probe draws back between two fibres.
    stuck : int
        Fibres in a row that a hand cannot put away before it stands aside.
    """

    apart_um: float = Field(250.0, gt=0.0)
    behind_um: float = Field(4000.0, gt=0.0)
    beside_um: float = Field(1000.0, ge=0.0)
    hidden_um: float = Field(400.0, ge=0.0)
    probe_back_um: float = Field(1500.0, gt=0.0)
    stuck: int = Field(3, ge=1)
