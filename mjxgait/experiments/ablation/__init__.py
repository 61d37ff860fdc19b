"""Ablation studies: variants of the settings times seeds, evolved side by side, compared with error
bars.

Data flow: plan (what to run) -> rows (runs it) -> measures (one number per run) -> statistics ->
report.
"""
