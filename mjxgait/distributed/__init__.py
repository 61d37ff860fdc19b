"""Work for other hands: what a run hands out, who does it, here or on the machines of a cluster.

Ray is imported only where `--cluster` names an address (docs/cluster.md).
"""
