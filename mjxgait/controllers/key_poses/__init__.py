"""Key poses that stable PD tracks (Wilson)."""

from mjxgait.kinds import ControllerKind

KINDS = (
    ControllerKind(
        name="poses",
        home=__name__,
        controller="controller:PoseTracker",
        reference="reference:PoseReference",
        serializer="serialize:PoseSerializer",
        report="report:PoseView",
        what="key poses that stable PD tracks (Wilson)",
    ),
)
