"""Distributed evolution: jobs and their workers, here or on the machines of a cluster.

Ray is imported only if `--cluster` names an address (docs/guide/cluster.md).
"""
