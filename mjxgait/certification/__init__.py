"""Stable-walk certificate, in NumPy and C MuJoCo, free of JAX (docs/reference/certificate.md)."""

from mjxgait.certification.certificate import (
    Certificate,
    NominalCheck,
    distance,
    push_ladder,
    record,
    survival,
)
from mjxgait.certification.config import CertificateConfig
from mjxgait.certification.criteria import Criterion, Measure
from mjxgait.certification.skills import certify, nominal_check, trial_run
from mjxgait.certification.state import (
    Lack,
    NoCertificate,
    ValidCertificate,
    certificate_state,
)
from mjxgait.certification.validity import (
    outdated,
    read_certificate,
    read_stress,
    stress_in_words,
)
from mjxgait.certification.verdict import (
    Verdict,
    criteria_of,
    verdict_of,
    verdict_on,
)

__all__ = [
    "Certificate",
    "CertificateConfig",
    "Criterion",
    "Lack",
    "Measure",
    "NoCertificate",
    "NominalCheck",
    "ValidCertificate",
    "Verdict",
    "certificate_state",
    "certify",
    "criteria_of",
    "distance",
    "nominal_check",
    "outdated",
    "push_ladder",
    "read_certificate",
    "read_stress",
    "record",
    "stress_in_words",
    "survival",
    "trial_run",
    "verdict_of",
    "verdict_on",
]
