"""Walk task: episode statistics, fitness terms, targets and acceptance criteria."""
