"""Ablation studies: variants of the settings × seeds, evolved side by side, with error bars.

Data flow: plan (the runs) -> rows (runs them) -> measures (one number per run) -> statistics ->
report.
"""
