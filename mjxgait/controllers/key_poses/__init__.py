"""Key poses that stable PD tracks (Wilson)."""

from mjxgait.kinds import ControllerKind

KINDS = (
    ControllerKind(
        name="poses",
        home=__name__,
        controller="controller:PoseTracker",
        reference="reference:PoseTwin",
        serializer="serialize:PoseCodec",
        report="report:PoseView",
    ),
)
