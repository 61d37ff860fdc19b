"""The stable-walk certificate, in NumPy and C MuJoCo, free of JAX (docs/certificate.md)."""

from mjxgait.certify.certificate import (
    Certificate,
    Glance,
    certify,
    distance,
    glance,
    push_ladder,
    record,
    survival,
)
from mjxgait.certify.config import CertificateConfig
from mjxgait.certify.criteria import Criterion, Measure
from mjxgait.certify.rehearsal import rehearse
from mjxgait.certify.standing import outdated, read_certificate, read_stress
from mjxgait.certify.verdict import Verdict, criteria_of, judge, judged

__all__ = [
    "Certificate",
    "CertificateConfig",
    "Criterion",
    "Glance",
    "Measure",
    "Verdict",
    "certify",
    "criteria_of",
    "distance",
    "glance",
    "judge",
    "judged",
    "outdated",
    "push_ladder",
    "read_certificate",
    "read_stress",
    "record",
    "rehearse",
    "survival",
]
