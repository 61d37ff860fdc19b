"""Bodies and brains that grow from one graph (Sims 1994)."""

from mjxgait.kinds import ControllerKind

KINDS = (
    ControllerKind(
        name="brain",
        home=__name__,
        controller="controller:Brains",
        reference="reference:brain_reference",
        opponent="reference:opponent_reference",
        serializer="serialize:GraphSerializer",
        report="report:GraphView",
        grows=True,
        what="neurons that grow with the body (Sims)",
    ),
)
