"""One expression tree per joint (Gritz & Hahn 1995, 1997)."""

from mjxgait.kinds import ControllerKind

KINDS = (
    ControllerKind(
        name="program",
        home=__name__,
        controller="controller:Programs",
        reference="reference:ExpressionReference",
        serializer="serialize:ExpressionSerializer",
        report="report:ProgramView",
        what="an expression for each joint (Gritz & Hahn)",
    ),
)
