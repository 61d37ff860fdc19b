"""Tasks: initial conditions, episode statistics, fitness terms and acceptance criteria."""
