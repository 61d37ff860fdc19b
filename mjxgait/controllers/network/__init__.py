"""Small neural network from observations to joint angles, as reinforcement learning trains it."""

from mjxgait.kinds import ControllerKind

KINDS = (
    ControllerKind(
        name="network",
        home=__name__,
        controller="controller:Network",
        reference="reference:NetworkReference",
        serializer="serialize:NetworkSerializer",
        report="report:NetworkView",
        what="a small neural network, as reinforcement learning trains it",
    ),
)
